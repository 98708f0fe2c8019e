#include "integrator/scene_queries.h"

#include "film/refine.h"
#include "system/timer.h"

namespace glint {
namespace {

SceneQueries& of(void* self) { return *static_cast<SceneQueries*>(self); }

}  // namespace

SceneQueries::SceneQueries(const Scene& scene, const RenderPlan& plan, const Stages& stages,
                           Scratch& scratch)
    : scene_(scene), stages_(stages), scratch_(scratch) {
  if (!scene.programs.asks_rays && !scene.materials.has_subsurface) return;
  alone_.assign(scene.instances.placements.size(), Opacity::kClear);
  own_.of_instance = alone_.data();
  own_.alone = true;
  layers_.resize(kBlock * Layers::kMost);
  const size_t rows = layers_.size() + kPad;
  columns_.reserve(rows);
  for (std::vector<uint32_t>* v : {&point_, &instance_, &primitive_, &material_}) v->resize(rows);
  u_.resize(rows);
  v_.resize(rows);
  outside_.resize(rows);
  queries_.self = this;
  queries_.blocked = [](void* self, const ProgramPoints& points, size_t count,
                        const AskedRays& rays, AskedOf what, uint8_t* blocked) {
    of(self).find_blocked(points, count, rays, what, blocked);
  };
  queries_.nearest = [](void* self, const ProgramPoints& points, size_t count,
                        const AskedRays& rays,
                        AskedOf what) { return of(self).find_nearest(points, count, rays, what); };
  queries_.crossings = [](void* self, const ProgramPoints& points, size_t count,
                          const AskedRays& rays) {
    return of(self).find_crossings(points, count, rays);
  };
  queries_.table = plan.node_points;
  queries_.rows = plan.node_point_count;
  queries_.reach = scene.world.occlusion_distance;
}

const RayQueries* SceneQueries::at(const Batch& batch, uint32_t sample, RayCounts& counts) {
  batch_ = &batch;
  counts_ = &counts;
  asked_ = &counts.shadow;
  queries_.sample = sample;
  return &queries_;
}

void SceneQueries::probe(const Batch& batch, RayCounts& counts) {
  batch_ = &batch;
  counts_ = &counts;
  asked_ = &counts.probe;
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
  *asked_ += chosen_.count;
  for (size_t i = 0; i < chosen_.count; ++i) {
    const uint32_t row = points.row[chosen_.from[i]];
    batch_->charge(row);
    if (batch_->soft_light) batch_->mark_soft_light(row, Refinement::kReached);
  }
}

/// body(rays) for rays that are asked and that meet the same things: all, or of each instance its
/// own, which is of the Kind `own`.
template <class Body>
void SceneQueries::each_choice(const ProgramPoints& points, size_t count, const AskedRays& rays,
                               AskedOf of, uint8_t own, Body body) {
  const auto is_asked = [&](uint32_t k) { return rays.t_max[k] > 0; };
  const auto choose = [&](auto wanted) {
    chosen_.count = 0;
    for (uint32_t k = 0; k < count; ++k)
      if (is_asked(k) && wanted(k)) chosen_.add(rays, k);
    if (chosen_.count > 0) charge(points);
    return chosen_.count > 0;
  };
  const auto run = [&](const Rays& some) {
    const Timer timer(counts_->tracing);
    body(some);
  };
  if (of != AskedOf::kOwn) {
    const uint32_t seen = of == AskedOf::kShadows ? uint32_t(kShadow) : uint32_t(kAnyRay);
    if (choose([](uint32_t) { return true; })) run(chosen_.rays(seen, nullptr));
    return;
  }
  for (uint32_t first = 0; first < count; ++first) {
    const uint32_t instance = points.instance[first];
    bool is_new = is_asked(first);
    for (uint32_t k = 0; is_new && k < first; ++k)
      is_new = !(is_asked(k) && points.instance[k] == instance);
    if (!is_new || !choose([&](uint32_t k) { return points.instance[k] == instance; })) continue;
    alone_[instance] = own;
    run(chosen_.rays(kAnyRay, &own_));
    alone_[instance] = Opacity::kClear;
  }
}

void SceneQueries::find_blocked(const ProgramPoints& points, size_t count, const AskedRays& rays,
                                AskedOf of, uint8_t* blocked) {
  std::fill_n(blocked, count, uint8_t(0));
  uint8_t found[kBlock + kPad];
  each_choice(points, count, rays, of, Opacity::kSolid, [&](const Rays& some) {
    scene_.trees.accel().occluded(some, found, scratch_);
    for (size_t i = 0; i < some.count; ++i) blocked[chosen_.from[i]] = found[i] != 0;
  });
}

AskedHits SceneQueries::find_nearest(const ProgramPoints& points, size_t count,
                                     const AskedRays& rays, AskedOf of) {
  hits_ = 0;
  double t[kBlock + kPad];
  uint32_t instance[kBlock + kPad], primitive[kBlock + kPad];
  float u[kBlock + kPad], v[kBlock + kPad];
  each_choice(points, count, rays, of, Opacity::kSolid, [&](const Rays& some) {
    scene_.trees.accel().closest(some, {t, instance, primitive, u, v}, scratch_);
    for (size_t i = 0; i < some.count; ++i)
      if (instance[i] != Hit::kNone) add_hit(i, {t[i], instance[i], primitive[i], u[i], v[i]});
  });
  return placed();
}

/// Of hits at one distance the first counts.
AskedHits SceneQueries::find_crossings(const ProgramPoints& points, size_t count,
                                       const AskedRays& rays) {
  hits_ = 0;
  uint8_t found[kBlock + kPad], dimmed[kBlock + kPad];
  each_choice(points, count, rays, AskedOf::kOwn, Opacity::kVaried, [&](const Rays& some) {
    scene_.trees.accel().find_layers(some, {layers_.data(), found}, dimmed, scratch_);
    for (size_t i = 0; i < some.count; ++i) {
      const Hit* hit = layers_.data() + i * Layers::kMost;
      double from = 0;
      for (const Hit* const end =
               hit + (dimmed[i] ? std::min<uint32_t>(found[i], Layers::kMost) : 0);
           hit < end; ++hit) {
        if (!(hit->t > from)) continue;
        from = beyond(hit->t);
        add_hit(i, *hit);
      }
    }
  });
  return placed();
}

/// Of the chosen ray of this number.
void SceneQueries::add_hit(size_t ray, const Hit& hit) {
  const size_t k = hits_++;
  for (size_t c = 0; c < 6; ++c) columns_[kStart + c][k] = chosen_.column[c][ray];
  columns_[kT][k] = hit.t;
  point_[k] = chosen_.from[ray];
  instance_[k] = hit.instance;
  primitive_[k] = hit.primitive;
  u_[k] = hit.u;
  v_[k] = hit.v;
}

/// The surfaces of the hits.
AskedHits SceneQueries::placed() {
  std::fill_n(instance_.begin() + ptrdiff_t(hits_), kPad, uint32_t(Hit::kNone));
  SurfaceStage stage{};
  stage.count = hits_;
  stage.instance = instance_.data();
  stage.primitive = primitive_.data();
  stage.u = u_.data();
  stage.v = v_.data();
  stage.instances = scene_.instances.shapes.data();
  stage.groups = scene_.instances.group_shapes.data();
  PointColumns& at = stage;
  AskedHits hits{hits_, point_.data(),  instance_.data(), primitive_.data(), {}, {}, {},
                 {},    outside_.data()};
  for (size_t c = 0; c < 3; ++c) {
    stage.start[c] = columns_[kStart + c];
    stage.d[c] = columns_[kD + c];
    hits.x[c] = at.x[c] = columns_[kX + c];
    hits.g[c] = at.g[c] = columns_[kG + c];
    hits.n[c] = at.n[c] = columns_[kN + c];
    at.origin[c] = columns_[kOrigin + c];
  }
  at.offset = columns_[kOffset];
  for (size_t c = 0; c < 2; ++c) hits.weights[c] = at.weights[c] = columns_[kWeights + c];
  at.outside = outside_.data();
  at.material = material_.data();
  if (hits_ > 0) stages_.surface(stage);
  for (size_t k = 0; !scene_.instances.only_meshes && k < hits_; ++k) {
    if (material_[k] != kNoMaterial) continue;
    const Surface s = surface_at(scene_, row(stage.start, k), row(stage.d, k),
                                 {columns_[kT][k], instance_[k], primitive_[k], u_[k], v_[k]});
    set_row(at.x, k, s.x);
    set_row(at.g, k, s.g);
    set_row(at.n, k, s.n);
    for (size_t c = 0; c < 2; ++c) at.weights[c][k] = s.weights[c + 1];
    outside_[k] = s.outside ? -1 : 0;
  }
  return hits;
}

}  // namespace glint
