// Rays that rough surfaces reflect towards others, in the directions that a sample draws from their
// lobes: the same for all pixels, or in pairs for those of a block, which mix what these bring.
#include <algorithm>

#include "integrator/direct.h"
#include "math/math.h"

namespace glint {

void DirectLight::reflect(const Batch& batch, uint32_t sample, Queue& glossy, RayCounts& counts) {
  const double* const place = plan_.lobe_point(sample, batch.queue->reflections);
  set_place(stage_, place[0], place[1]);
  push_reflected(batch, glossy, counts);
}

void DirectLight::reflect_in_blocks(const Batch& batch, const std::vector<uint32_t>& pixels,
                                    uint32_t sample, Queue& glossy, Queue& mixed,
                                    BlockShares& shares, RayCounts& counts) {
  given_.assign(batch.size(), {});
  set_place(stage_, 0, 0);  // where n mirrors
  const size_t count = stages_.reflect(stage_);
  for (size_t k = 0; k < count; ++k) {
    const Vec3d given = row(stage_.diffuse_out, k);
    if (stage_.t_max[k] < RenderPlan::kLeastUnmixed && finite(given)) given_[point_[k]] = given;
  }
  for (size_t k = 0; k < batch.size(); ++k) batch.mark_thrown(batch.queue->slot(k), given_[k]);
  shares.set(plan_, batch, pixels, given_);
  place_.resize(batch.size());
  constexpr uint8_t kUnmixed = 0xff;
  for (uint32_t k = 0; k < batch.size(); ++k)
    place_[k] = any(given_[k]) ? uint8_t(shares.turn(k, sample)) : kUnmixed;
  const auto push = [&](uint8_t turn, const double* place, Queue& to) {
    linked_.assign(batch.lit.size(), 0);
    for (size_t k = 0; k < batch.size(); ++k)
      if (place_[k] == turn) linked_[k] = batch.lit[k];
    stage_.lit = linked_.data();
    set_place(stage_, place[0], place[1]);
    push_reflected(batch, to, counts);
  };
  push(kUnmixed, plan_.lobe_point(sample, 0), glossy);
  push(BlockShares::kAlone, plan_.lobe_point(sample, 0), mixed);
  push(BlockShares::kFirst, plan_.gloss_places.row(sample, 0), mixed);
  push(BlockShares::kSecond, plan_.gloss_places.row(sample, 1), mixed);
  stage_.lit = batch.lit.data();
}

/// The rays that the stage's points reflect.
void DirectLight::push_reflected(const Batch& batch, Queue& glossy, RayCounts& counts) {
  const Queue& queue = *batch.queue;
  const size_t count = stages_.reflect(stage_);
  for (size_t k = 0; k < count; ++k) {
    const uint32_t from = point_[k];
    Path path = queue.path(from);
    path.T = row(stage_.diffuse_out, k);
    const double weight = max_abs(path.T);
    if (path.depth >= plan_.max_bounces || weight < plan_.cutoff || !finite(path.T)) continue;
    path.start = row(batch.points.x, from);
    path.from = 0;
    path.straight = 0;
    path.wants_data = false;
    path.skyless = true;
    path.widest = std::min(path.widest, stage_.t_max[k]);
    ++path.depth;
    batch.mark_thrown(path.slot, path.T);
    if (batch.soft_light) batch.mark_soft_light(from, Refinement::kReached);
    glossy.push({row(stage_.o, k), row(stage_.to, k), 0, kInfinity, kMirror}, path);
    ++counts.mirror;
  }
}

}  // namespace glint
