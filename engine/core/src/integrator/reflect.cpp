// Rays that rough surfaces reflect towards others, in the directions that a sample draws from their
// lobes.
#include <algorithm>

#include "integrator/direct.h"
#include "math/math.h"

namespace glint {

void DirectLight::reflect(const Batch& batch, uint32_t sample, Queue& glossy, RayCounts& counts) {
  const double* const place = plan_.lobe_point(sample, batch.queue->past.reflections);
  for (size_t c = 0; c < 2; ++c) std::fill_n(disc_[c].begin(), batch.size(), place[c]);
  const size_t count = stages_.reflect(onward(batch.lit.data()));
  for (size_t k = 0; k < count; ++k) push_reflected(batch, k, glossy, counts);
}

/// The k-th of the rays that the stage's points reflect.
void DirectLight::push_reflected(const Batch& batch, size_t k, Queue& glossy, RayCounts& counts) {
  const uint32_t from = point_[k];
  Path path = batch.queue->path(from);
  path.T = row(rays_.diffuse, k);
  const double weight = max_abs(path.T);
  if (path.depth >= plan_.max_bounces || weight < plan_.cutoff || !finite(path.T)) return;
  path.start = row(batch.points.x, from);
  path.from = 0;
  path.straight = 0;
  path.wants_data = false;
  path.skyless = true;
  path.widest = std::min(path.widest, rays_.t_max[k]);
  ++path.depth;
  batch.mark_thrown(path.slot, path.T);
  if (batch.soft_light) batch.mark_soft_light(from, Refinement::kReached);
  glossy.push({row(rays_.o, k), row(rays_.to, k), 0, kInfinity, kMirror}, path);
  ++counts.mirror;
}

}  // namespace glint
