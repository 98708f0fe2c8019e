// What a first wave found out and a later one of another light, material or world need not trace
// again: where its rays hit, and which points see which sample of a light.
#pragma once
#include <cstdint>
#include <mutex>
#include <vector>

#include "bvh/accel.h"
#include "film/film.h"
#include "glint.h"
#include "integrator/plan.h"
#include "scene/first_hit_caches.h"
#include "shading/stages.h"
#include "system/zeroed_buffer.h"

namespace glint {

struct Scene;

/// Of one camera, region and first sample point, in one accelerator. 24 bytes a pixel, and one for
/// each of the first light samples. Its rows are the film's; threads may write rows of different
/// tiles at once. Whoever uses it holds `mutex`.
class FirstHitCache {
 public:
  static constexpr size_t kMaxColumns = 8;

  FirstHitCache(const GlintCamera& camera, const RenderPlan& plan, const Film& film);
  bool is_of(const GlintCamera& camera, const RenderPlan& plan) const;

  /// Forgets shadows of light samples that are not those of `scene`.
  void expect(const Scene& scene, const RenderPlan& plan);

  /// False where the tile's rays were not kept.
  bool look_up(const Tile& tile, const Hits& hits) const;
  void keep(const Tile& tile, const Hits& hits);
  /// Shadow of each row in the light sample of that number: 0 unknown, 1 free, 2 blocked. Null for
  /// samples that are not kept.
  uint8_t* shadows(size_t number) {
    return number < columns_.size() ? columns_[number].shadows.data() : nullptr;
  }

  std::mutex mutex;

 private:
  /// Of a sample of a light, and what its shadow rays depend on.
  struct Column {
    LightShape shape;
    SamplePlace place;
    ZeroedBuffer<uint8_t> shadows;
    bool is_of(const LightSample& sample) const;
  };

  GlintCamera camera_;
  Region region_;
  double offset_[2];
  size_t rows_;
  ZeroedBuffer<double> t_;
  ZeroedBuffer<uint32_t> instance_, primitive_;
  ZeroedBuffer<float> u_, v_;
  std::vector<Column> columns_;
  ZeroedBuffer<uint8_t> kept_;  // by a tile's first row
};

}  // namespace glint
