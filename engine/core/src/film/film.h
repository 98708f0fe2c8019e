// Sums of samples per pixel, and the picture they make after each wave.
#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "film/cryptomatte.h"
#include "film/estimate.h"
#include "film/refine.h"
#include "film/resolve.h"
#include "glint.h"
#include "math/vec.h"
#include "shading/stages.h"

namespace glint {

/// Pixels [x0, x1) x [y0, y1) of the region, counted from its corner. Its pixels have slots: blocks
/// of 8 x 8 pixels one after the other, row by row within each, so that 64 neighbouring rays stay
/// narrow.
struct Tile {
  static constexpr uint32_t kSize = 32, kBlock = 8;
  uint32_t x0, y0, x1, y1;
  size_t first_sum,
      first_row;  // where the film keeps its sums; where columns over all tiles keep its slots
  size_t number;  // among the tiles of the film
  uint32_t width() const { return x1 - x0; }
  uint32_t height() const { return y1 - y0; }
  size_t pixels() const { return size_t(width()) * height(); }
  size_t stride() const { return (pixels() + kPad - 1) / kPad * kPad; }
};

/// The sum over each pixel of the tile and its neighbours, with add(sum, number) in place of +:
/// keep(number, sum). Numbers are those of pixels in a region of that size.
template <class Sum, class Add, class Keep>
void sum_neighborhoods(const Tile& tile, uint32_t width, uint32_t height, Add add, Keep keep) {
  for (uint32_t y = tile.y0; y < tile.y1; ++y)
    for (uint32_t x = tile.x0; x < tile.x1; ++x) {
      Sum sum{};
      for (uint32_t j = y - (y > 0); j <= std::min(y + 1, height - 1); ++j)
        for (uint32_t i = x - (x > 0); i <= std::min(x + 1, width - 1); ++i)
          sum = add(sum, size_t(j) * width + i);
      keep(size_t(y) * width + x, sum);
    }
}

/// Column and row, within the tile, of each slot of a tile of some size.
class SlotTable {
 public:
  /// Does nothing when the size is that of the last call.
  void set(uint32_t width, uint32_t height);
  const double* columns() const { return columns_.data(); }
  const double* rows() const { return rows_.data(); }
  /// How many slots from this one on are neighbours in a row.
  size_t run(size_t slot) const {
    return std::min(size_t(Tile::kBlock), width_ - size_t(columns_[slot]));
  }
  /// Number of the pixel in a region of that width.
  uint32_t pixel(const Tile& tile, size_t slot, uint32_t region_width) const {
    return (tile.y0 + uint32_t(rows_[slot])) * region_width + tile.x0 + uint32_t(columns_[slot]);
  }

 private:
  uint32_t width_ = 0, height_ = 0;
  std::vector<double> columns_, rows_;
};

/// What the data passes hold of a camera ray's first sample.
struct FirstHit {
  double depth = 0, grazing = 0;
  Vec3d position, normal, uv;
  int32_t object = 0, material = 0;
};

/// Largest finite floats stand for what does not fit, 0 for infinity minus infinity.
inline float to_float(double x) {
  constexpr double top = std::numeric_limits<float>::max();
  return x == x ? float(std::clamp(x, -top, top)) : 0;
}

/// Camera rays of some pixels of a tile beyond their samples, which light does not follow.
struct MoreSeen {
  std::vector<uint32_t> slots;
  uint32_t rays = 0;         // of each
  std::vector<double> sums;  // the tile's, with theirs
};

/// One thread a tile at a time. Sums are kept tile by tile, a column a channel: Combined's colour,
/// lost alpha, then three for each part.
class Film {
 public:
  Film(Region region, Passes passes) : Film(region, region, region, passes, 0, 1) {}
  /// shown: what `picture` gives of the region.  traced, error_threshold, light_samples: see
  /// Refinement. crypto_ids: how many of a pixel Cryptomatte passes tell. aov_count, light_groups:
  /// of the scene. resolved: side of the blocks of pixels over which light is averaged, 1 for none;
  /// of the passes of light then those alone are kept that are in `lights`, unless one is asked
  /// for. Catchers show the surroundings where Environment is in them.
  Film(Region region, Region traced, Region shown, Passes passes, double error_threshold,
       uint32_t light_samples, uint32_t crypto_ids = 0, uint32_t aov_count = 0,
       uint32_t light_groups = 0, bool gloss = false, uint32_t resolved = 1,
       Passes lights = kLightingPasses);

  const std::vector<Tile>& tiles() const { return tiles_; }
  const Region& region() const { return region_; }
  /// Columns of sums, and the first of a part's, of Cost's or of Fallbacks'; -1 where nobody asked.
  size_t columns() const { return columns_; }
  /// The last two columns of sums, where rough surfaces reflect others: the largest channel of what
  /// they bring, and of the rest. Else -1.
  int gloss_column() const { return gloss_; }
  int column_of(int pass) const { return at_[pass]; }
  /// Those that camera rays add to which no light follows.
  const std::vector<uint32_t>& columns_of_rays() const { return columns_of_rays_; }
  /// Rows of a column over all tiles.
  size_t rows() const { return sums_.size() / columns_; }
  Passes passes() const { return passes_; }
  bool wants(int pass) const { return passes_ >> pass & 1; }
  bool wants_data() const { return passes_ & kDataPasses; }
  /// Passes that are the mean over the samples of what camera rays see.
  bool wants_seen() const { return passes_ & kSeenPasses; }
  bool wants_lighting() const { return passes_ & kLightingPasses; }
  /// Whether there are sums of light by the kind of surface, for passes or to be resolved.
  bool keeps_lighting() const { return at_[kFirstLighting] >= 0; }
  bool resolves() const { return resolve_.on(); }
  /// The column of that number of those that `Resolve` reads beside the passes of light; -1 for
  /// none. Normals, places and shares follow one another.
  int guide_column(int number) const { return guides_[number]; }
  bool wants_denoising() const { return passes_ & kDenoisingPasses; }
  bool wants_cryptomatte() const { return cryptomatte_.on(); }
  /// Channels of a pass, 0 for no such pass.
  size_t channels_of(int pass) const;
  Cryptomatte& cryptomatte() { return cryptomatte_; }
  Refinement& refinement() { return refinement_; }
  ErrorEstimate& estimate() { return estimate_; }

  /// The first of the sums of a part, of Cost or of Fallbacks; null where nobody asked. The next
  /// channels follow after tile.stride().
  double* sums(const Tile& tile, int pass) {
    return at_[pass] < 0 ? nullptr
                         : sums_.data() + tile.first_sum + size_t(at_[pass]) * tile.stride();
  }
  /// The tile with its sums, all 0, where others put theirs before: for tiles that are published as
  /// soon as they are traced. Of each thread its own thread, below the number of tiles.
  Tile on_thread(const Tile& tile, size_t thread);
  /// Before the sums of these slots get their sample number `sample`: what the halves of the
  /// samples are told apart by.
  void note_half(const Tile& tile, const std::vector<uint32_t>& slots, uint32_t sample);
  bool wants_depth_alone() const { return (passes_ & kDataPasses) == pass_bit(GLINT_PASS_DEPTH); }
  void set_data(uint32_t pixel, const FirstHit& hit);
  void set_depth(uint32_t pixel, double depth) {
    values(GLINT_PASS_DEPTH)[pixel] = to_float(depth);
  }
  void set_vector(uint32_t pixel, const double (&motion)[4]) {
    store(GLINT_PASS_VECTOR, pixel, motion);
  }
  void set_gap(uint32_t pixel, double gap) { store(GLINT_PASS_GAP, pixel, &gap); }

  /// What a wave of that many samples says of the tile's error; then, after the first ones, with
  /// that of neighbours.
  void measure(const Tile& tile, const SlotTable& slots, uint32_t samples);
  void measure_neighborhood(const Tile& tile);
  /// What resolving reads, while nothing writes sums: the tile and what is round it after so many
  /// samples.
  ResolveWindow window_of(const Tile& tile, uint32_t samples) const;
  /// The slots of pixels that more camera rays would tell more about.
  std::vector<uint32_t> uneven(const Tile& tile, const ResolveWindow& window) const;
  /// Before a wave is measured and published: what resolving its light adds to the tile's pixels.
  /// more: null for none.
  void resolve(const Tile& tile, uint32_t samples, const ResolveWindow& window,
               const MoreSeen* more);
  /// Before a wave is published: pictures that somebody has are left to them, and others take their
  /// place.
  void renew();
  /// Makes the tile's sums of `samples` samples the picture that `picture` gives.
  void publish(const Tile& tile, const SlotTable& slots, uint32_t samples, const Stages& stages);
  /// What was published last, of the pixels that are shown, and nothing will write any more; null
  /// when the pass was not asked for or the size differs.
  std::shared_ptr<ZeroedBuffer<float>> picture(int pass, uint64_t size);
  /// After the last wave: only pictures are left.
  void forget_sums();

 private:
  static constexpr Passes kDataPasses =
      ((pass_bit(GLINT_PASS_ERROR)) - (pass_bit(GLINT_PASS_DEPTH))) | pass_bit(GLINT_PASS_GRAZING) |
      pass_bit(GLINT_PASS_GAP) | pass_bit(GLINT_PASS_VECTOR);
  static constexpr Passes kHealthPasses = pass_bit(GLINT_PASS_ERROR) |
                                          pass_bit(GLINT_PASS_SAMPLES) | pass_bit(GLINT_PASS_COST) |
                                          pass_bit(GLINT_PASS_FALLBACKS);
  static constexpr Passes kDenoisingPasses = pass_bit(GLINT_PASS_DENOISING_NORMAL) |
                                             pass_bit(GLINT_PASS_DENOISING_ALBEDO) |
                                             pass_bit(GLINT_PASS_DENOISING_DEPTH);
  static constexpr Passes kSeenPasses = kDenoisingPasses | pass_bit(GLINT_PASS_MIST) |
                                        pass_bit(GLINT_PASS_AOV) | Cryptomatte::kPasses;
  void find_columns_of_rays();
  void keep_sums(int pass, int channels);
  std::shared_ptr<ZeroedBuffer<float>> cropped(int pass) const;
  double* column_at(const Tile& tile, int column) const {
    return sums_.data() + tile.first_sum + size_t(column) * tile.stride();
  }
  float* values(int pass) const { return pictures_[pass]->data(); }
  void store(int pass, uint32_t pixel, const double* from);
  struct PixelSums;
  void read(ResolveWindow& window, size_t at, const PixelSums& pixel) const;
  void read_guides(ResolveWindow& window, size_t at, const PixelSums& pixel, GuideSet set) const;
  void read_noise(ResolveWindow& window, size_t at, const PixelSums& pixel) const;
  double guide(const PixelSums& pixel, int number) const;
  double whole(const PixelSums& pixel, int pass) const;
  void publish_means(const Tile& tile, int pass, const SlotTable& slots, uint32_t samples,
                     const Stages& stages);
  void add_resolved(const Tile& tile, int pass, const SlotTable& slots,
                    float (&means)[4][Tile::kSize * Tile::kSize]) const;
  void resolve_groups(const Tile& tile, const SlotTable& slots, uint32_t samples);
  void publish_lighting(const Tile& tile, const SlotTable& slots, uint32_t samples);
  /// Means of a pass's sums; is_rest: 1 and the means.
  void publish_seen(const Tile& tile, int pass, const SlotTable& slots, uint32_t samples,
                    bool is_rest = false);
  void publish_cryptomatte(const Tile& tile, const SlotTable& slots, uint32_t samples);
  void publish_health(const Tile& tile, const SlotTable& slots, uint32_t samples);
  void cut();

  Region region_, shown_;
  Passes passes_;
  uint32_t aov_count_, light_groups_;
  std::vector<Tile> tiles_;
  size_t columns_ = 4;
  std::vector<uint32_t> columns_of_rays_;
  int gloss_ = -1, guides_[kGuideColumns];
  int at_[kSumCount];  // first column of what has sums, -1 for none
  ZeroedBuffer<double> sums_;
  Refinement refinement_;
  ErrorEstimate estimate_;
  Cryptomatte cryptomatte_;
  Resolve resolve_;
  std::shared_ptr<ZeroedBuffer<float>> pictures_[GLINT_PASS_COUNT];
  Passes lent_ = 0, renewed_ = 0;  // passes whose pictures somebody else has as well; that are
                                   // new and empty for this wave
};

}  // namespace glint
