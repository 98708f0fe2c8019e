// Rays that rough surfaces reflect towards others, in the directions that a sample draws from their
// lobes: the same for all pixels, or in several for those of a block, which mix what these bring.
#include <algorithm>

#include "integrator/direct.h"
#include "math/math.h"

namespace glint {

void DirectLight::reflect(const Batch& batch, uint32_t sample, Queue& glossy, RayCounts& counts) {
  place_in_lobes(0, batch.size(), plan_.lobe_point(sample, batch.queue->reflections));
  const size_t count = stages_.reflect(stage_);
  for (size_t k = 0; k < count; ++k) push_reflected(batch, k, glossy, counts);
}

void DirectLight::reflect_in_blocks(const Batch& batch, const std::vector<uint32_t>& pixels,
                                    uint32_t sample, Queue& glossy, Queue& mixed,
                                    BlockShares& shares, RayCounts& counts) {
  given_.assign(batch.size(), {});
  exponents_.assign(batch.size(), 0);
  constexpr double kMiddle[2] = {};
  place_in_lobes(0, batch.size(), kMiddle);  // where n mirrors
  size_t count = stages_.reflect(stage_);
  for (size_t k = 0; k < count; ++k) {
    const Vec3d given = row(stage_.diffuse_out, k);
    if (!(stage_.t_max[k] < RenderPlan::kLeastUnmixed) || !finite(given)) continue;
    given_[point_[k]] = given;
    exponents_[point_[k]] = stage_.t_max[k];
  }
  for (size_t k = 0; k < batch.size(); ++k) batch.mark_thrown(batch.queue->slot(k), given_[k]);
  shares.set(plan_, batch, pixels, BlockGrid::of_gloss(sample), given_, nullptr, &exponents_);
  constexpr uint8_t kUnmixed = BlockShares::kWaits + 1;
  place_.resize(batch.size());
  linked_.assign(batch.lit.size(), 0);
  for (uint32_t k = 0; k < batch.size(); ++k) {
    const uint8_t turn = shares.turn(k, sample);
    place_[k] = any(given_[k]) ? turn : kUnmixed;
    if (place_[k] == BlockShares::kWaits) continue;
    linked_[k] = batch.lit[k];
    place_in_lobes(k, k + 1,
                   turn < BlockShares::kAlone ? plan_.gloss_places.row(sample, turn)
                                              : plan_.lobe_point(sample, 0));
  }
  stage_.lit = linked_.data();
  count = stages_.reflect(stage_);
  stage_.lit = batch.lit.data();
  for (uint8_t place = 0; place <= kUnmixed; ++place)  // rays of one direction go down together
    for (size_t k = 0; k < count; ++k)
      if (place_[point_[k]] == place)
        push_reflected(batch, k, place == kUnmixed ? glossy : mixed, counts);
}

/// Where in their lobes the stage's points from `first` to before `end` reflect their rays.
void DirectLight::place_in_lobes(size_t first, size_t end, const double* place) {
  for (size_t c = 0; c < 2; ++c)
    std::fill(disc_[c].begin() + ptrdiff_t(first), disc_[c].begin() + ptrdiff_t(end), place[c]);
}

/// The k-th of the rays that the stage's points reflect.
void DirectLight::push_reflected(const Batch& batch, size_t k, Queue& glossy, RayCounts& counts) {
  const uint32_t from = point_[k];
  Path path = batch.queue->path(from);
  path.T = row(stage_.diffuse_out, k);
  const double weight = max_abs(path.T);
  if (path.depth >= plan_.max_bounces || weight < plan_.cutoff || !finite(path.T)) return;
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

}  // namespace glint
