#include "integrator/scene_queries.h"

#include "film/refine.h"
#include "session/timer.h"

namespace glint {

SceneQueries::SceneQueries(const Scene& scene, const RenderPlan& plan, Scratch& scratch)
    : scene_(scene), scratch_(scratch) {
  if (!scene.asks_rays) return;
  alone_.assign(scene.placements.size(), Opacity::kClear);
  own_.of_instance = alone_.data();
  own_.alone = true;
  queries_ = {this, blocked, plan.node_points, plan.node_point_count, 0, scene.occlusion_distance};
}

const RayQueries* SceneQueries::at(const Batch& batch, uint32_t sample, RayCounts& counts) {
  batch_ = &batch;
  counts_ = &counts;
  queries_.sample = sample;
  return &queries_;
}

void SceneQueries::Chosen::add(const AskedRays& rays, uint32_t k) {
  for (size_t c = 0; c < 3; ++c) {
    column[c][count] = rays.o[c][k];
    column[3 + c][count] = rays.d[c][k];
  }
  column[6][count] = 0;
  column[7][count] = rays.t_max[k];
  from[count++] = k;
}

Rays SceneQueries::Chosen::rays(uint32_t visibility, const Opacity* opacity) const {
  return {{column[0], column[1], column[2]},
          {column[3], column[4], column[5]},
          column[6],
          column[7],
          count,
          visibility,
          opacity};
}

void SceneQueries::charge(const ProgramPoints& points) {
  counts_->shadow += chosen_.count;
  for (size_t i = 0; i < chosen_.count; ++i) {
    const uint32_t row = points.row[chosen_.from[i]];
    batch_->charge(row);
    if (batch_->softly_lit) batch_->mark_softly_lit(row, Refinement::kReached);
  }
}

/// body(rays) for rays that are asked and that meet the same things: all, or of each instance its
/// own.
template <class Body>
void SceneQueries::each_choice(const ProgramPoints& points, size_t count, const AskedRays& rays,
                               AskedOf of, Body body) {
  const auto is_asked = [&](uint32_t k) { return rays.t_max[k] > 0; };
  const auto choose = [&](auto wanted) {
    chosen_.count = 0;
    for (uint32_t k = 0; k < count; ++k)
      if (is_asked(k) && wanted(k)) chosen_.add(rays, k);
    if (chosen_.count == 0) return false;
    charge(points);
    return true;
  };
  if (of == AskedOf::kAll) {
    if (choose([](uint32_t) { return true; })) body(chosen_.rays(kShadow, nullptr));
    return;
  }
  for (uint32_t first = 0; first < count; ++first) {
    const uint32_t own = points.instance[first];
    bool is_new = is_asked(first);
    for (uint32_t k = 0; is_new && k < first; ++k)
      is_new = !(is_asked(k) && points.instance[k] == own);
    if (!is_new || !choose([&](uint32_t k) { return points.instance[k] == own; })) continue;
    alone_[own] = Opacity::kSolid;
    body(chosen_.rays(kCamera | kMirror | kShadow, &own_));
    alone_[own] = Opacity::kClear;
  }
}

void SceneQueries::find_blocked(const ProgramPoints& points, size_t count, const AskedRays& rays,
                                AskedOf of, uint8_t* blocked) {
  std::fill_n(blocked, count, uint8_t(0));
  uint8_t found[kBlock + kPad];
  each_choice(points, count, rays, of, [&](const Rays& some) {
    {
      const Timer timer(counts_->tracing);
      scene_.accel().occluded(some, found, scratch_);
    }
    for (size_t i = 0; i < chosen_.count; ++i) blocked[chosen_.from[i]] = found[i] != 0;
  });
}

void SceneQueries::blocked(void* self, const ProgramPoints& points, size_t count,
                           const AskedRays& rays, AskedOf of, uint8_t* blocked) {
  static_cast<SceneQueries*>(self)->find_blocked(points, count, rays, of, blocked);
}

}  // namespace glint
