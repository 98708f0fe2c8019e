// A wavefront over the rays of one tile and one sample: closest hits, shading by material, direct light, the rays that go on.
#pragma once
#include <atomic>
#include <vector>

#include "direct.h"
#include "shade.h"

namespace glint {

/// Pixels [x0, x1) x [y0, y1) of the region, counted from its corner.
struct Tile {
  static constexpr uint32_t kSize = 32;
  uint32_t x0, y0, x1, y1;
};

/// The region cut into tiles.
std::vector<Tile> tiles_of(const Region& region);

/// One thread's tracer. What a pixel receives, and in which order, depends on that pixel's rays alone: sample after sample, generation
/// after generation, hits of a generation by material and then by age. So tiles, regions and threads do not change a bit.
class Tracer {
 public:
  Tracer(const Scene& scene, const RenderPlan& plan, Film& film, const std::atomic<bool>& cancel);

  void trace(const Tile& tile, uint32_t sample);
  const RayCounts& counts() const { return work_.counts; }

 private:
  void camera_rays(const Tile& tile, uint32_t sample, Queue& queue);
  void process(const Queue& queue, uint32_t sample, Queue& next);
  void sort_by_material(const Queue& queue);
  Queue take();
  void give(Queue queue);

  const Scene& scene_;
  const RenderPlan& plan_;
  Film& film_;
  const std::atomic<bool>& cancel_;
  CameraRays camera_;
  Shader shader_;
  DirectLight direct_;
  Work work_;
  std::vector<Queue> waiting_, spare_;
  std::vector<Hit> hits_;
  std::vector<uint32_t> material_, order_, first_;  // of each ray; rays by material; where each material starts
};

}  // namespace glint
