// Some samples of some pixels of a tile, and what they bring until the film gets it.
#pragma once
#include <vector>

#include "film/film.h"
#include "integrator/columns.h"
#include "integrator/plan.h"
#include "scene/camera.h"

namespace glint {

/// Where some samples of a tile's pixels lie in the camera's window: of each column and row, one
/// after the other.
class WindowPoints {
 public:
  static constexpr uint32_t kMaxPacketSamples = 16;

  /// Places [first, first + count) of `offsets` in a pixel, of the samples from `sample` on of the
  /// tables of lenses and of where the camera is. count: a power of two up to kMaxPacketSamples.
  struct Run {
    const double* offsets;
    uint32_t first, count, sample;
  };
  void set(const CameraRays& camera, const RenderPlan& plan, const Tile& tile, Run run);

  uint32_t first() const { return first_; }
  uint32_t count() const { return count_; }
  const RenderPlan& plan() const { return *plan_; }
  /// The first of them in the tables of the camera.
  size_t camera_row(size_t column, size_t row) const {
    return plan_->camera_row(x0_ + column, y0_ + row) + sample_;
  }
  const double* u(size_t column) const { return u_ + column * count_; }
  const double* v(size_t row) const { return v_ + row * count_; }

 private:
  const RenderPlan* plan_ = nullptr;
  uint32_t first_ = 0, count_ = 1, sample_ = 0;
  uint32_t x0_ = 0, y0_ = 0;  // x0_, y0_: of the tile in the frame
  double u_[Tile::kSize * kMaxPacketSamples], v_[Tile::kSize * kMaxPacketSamples];
};

/// The camera rays of a few samples of a few pixels, and their paths from there. All samples of a
/// pixel are neighbours, so that the rays of a packet are near to each other. The film gets a
/// pixel's samples in their order, however many were traced at once.
class Paths {
 public:
  static constexpr size_t kMost = Tile::kSize * Tile::kSize;

  /// The samples of `points` of the slots [begin, end), at most kMost in all. alone: no light
  /// follows their rays.
  void choose(const Film& film, const SlotTable& places, const uint32_t* begin, const uint32_t* end,
              const WindowPoints& points, bool alone = false);

  size_t size() const { return slots_.size() << shift_; }
  uint32_t slot(size_t path) const { return slots_[path >> shift_]; }
  /// Whether they are one sample of all slots of that tile.
  bool is_whole(const Tile& tile) const { return shift_ == 0 && slots_.size() == tile.pixels(); }
  /// Whether it is a pixel's first sample.
  bool is_first(size_t path) const {
    return first_ == 0 && (path & ((size_t(1) << shift_) - 1)) == 0;
  }

  // Of each path: where its camera ray goes through the window.
  const double* u() const { return u_.data(); }
  const double* v() const { return v_.data(); }
  // and through the lens, and world_from_camera row by row; null where there is no such table.
  const double* lens(size_t axis) const { return at_least_one(lens_[axis]); }
  const double* frame(size_t number) const { return at_least_one(frame_[number]); }

  /// What the paths brought so far, as Film::sums has it; the next channels follow after
  /// `stride()`.
  double* sums(const Film& film, int pass) {
    return film.column_of(pass) < 0 ? nullptr : sums_[size_t(film.column_of(pass))];
  }
  /// The same of what a resolve reads, by its GuideColumn.
  double* guide(const Film& film, int number) {
    return film.guide_column(number) < 0 ? nullptr : sums_[size_t(film.guide_column(number))];
  }
  /// Until it is called again sums are those of what rough surfaces reflect, which begin with
  /// nothing.
  void swap() { std::swap(sums_, gloss_); }
  /// Adds that to the paths' sums: no more of it than a sample should bring.
  void add_gloss(Film& film, const Tile& tile);
  double* lost_alpha() { return sums_[3]; }
  size_t stride() const { return sums_.stride(); }
  /// The most that rough surfaces give back of what each path's rays from them meet.
  double* thrown() { return thrown_.data(); }
  /// Whether a soft light reached each path's camera ray: as Refinement::soft_light has it of
  /// slots.
  uint8_t* soft_light() { return soft_light_.data(); }
  /// Whether what each path's camera ray meets shows things through glass that blurs them.
  uint8_t* rough_glass() { return rough_glass_.data(); }
  /// Adds that to the film, sample by sample, and tells its refinement.
  void add_to(Film& film, const Tile& tile, const Stages& stages);
  /// Adds what rays alone tell to sums of the film's columns, each so long.
  void add_alone(const Film& film, double* sums, size_t stride) const;
  /// The same as if each of some slots, which are alike so far, had `samples` samples that bring
  /// what the only path here brought.
  void spread(Film& film, const Tile& tile, const std::vector<uint32_t>& slots,
              uint32_t samples) const;

 private:
  template <size_t Count>
  void place_samples(const SlotTable& places, const WindowPoints& points);
  template <size_t Count>
  void place_rows(const SlotTable& places, const WindowPoints& points, const double* table,
                  std::vector<double>* to, size_t width) const;
  template <size_t Count>
  void add_column(double* to, const double* from) const;
  template <size_t Count>
  void add_noted(double* to, const double* from, const Refinement::Ranges& ranges) const;

  uint32_t first_ = 0, shift_ = 0;
  std::vector<uint32_t> slots_;
  static const double* at_least_one(const std::vector<double>& v) {
    return v.empty() ? nullptr : v.data();
  }

  std::vector<double> u_, v_, lens_[2], frame_[12], thrown_;
  std::vector<uint8_t> soft_light_, rough_glass_;
  Columns sums_, gloss_;
  size_t columns_ = 0;
};

}  // namespace glint
