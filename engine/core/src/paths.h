// Some samples of some pixels of a tile, and what they bring until the film gets it.
#pragma once
#include <vector>

#include "columns.h"
#include "film.h"
#include "plan.h"

namespace glint {

/// The camera rays of a few samples of a few pixels, and their paths from there. All samples of a pixel are neighbours, so that the rays
/// of a bundle are near to each other. The film gets a pixel's samples in their order, however many were traced at once.
class Paths {
 public:
  static constexpr size_t kMost = Tile::kSize * Tile::kSize;

  /// Samples [first, first + count) of the slots [begin, end), at most kMost in all; count is a power of two.
  void choose(const Film& film, const SlotTable& places, const uint32_t* begin, const uint32_t* end, const RenderPlan& plan, uint32_t first,
              uint32_t count);

  size_t size() const { return slots_.size() << shift_; }
  uint32_t slot(size_t path) const { return slots_[path >> shift_]; }
  /// Whether they are one sample of all slots of that tile.
  bool is_whole(const Tile& tile) const { return shift_ == 0 && slots_.size() == tile.pixels(); }
  /// Whether it is a pixel's first sample.
  bool is_first(size_t path) const { return first_ == 0 && (path & ((size_t(1) << shift_) - 1)) == 0; }

  // Of each path: its pixel in the tile, and its point from the pixel's centre.
  const double* column() const { return column_.data(); }
  const double* row() const { return row_.data(); }
  const double* dx() const { return dx_.data(); }
  const double* dy() const { return dy_.data(); }

  /// What the paths brought so far, as Film::sums has it; the next channels follow after `stride()`.
  double* sums(const Film& film, int pass) { return film.column_of(pass) < 0 ? nullptr : sums_[size_t(film.column_of(pass))]; }
  double* lost_alpha() { return sums_[3]; }
  size_t stride() const { return sums_.stride(); }
  /// Whether a soft light reached each path's camera ray: as Refinement::softly_lit has it of slots.
  uint8_t* softly_lit() { return softly_lit_.data(); }
  /// Adds that to the film, sample by sample, and tells its refinement.
  void add_to(Film& film, const Tile& tile, const Stages& stages);

 private:
  void place_samples(const RenderPlan& plan);
  void add_column(double* to, const double* from) const;
  void add_noted(Film& film, const Tile& tile);

  uint32_t first_ = 0, shift_ = 0;
  std::vector<uint32_t> slots_;
  std::vector<double> column_, row_, dx_, dy_, before_;
  std::vector<uint8_t> softly_lit_;
  Columns sums_;
  size_t columns_ = 0;
};

}  // namespace glint
