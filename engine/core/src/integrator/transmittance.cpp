#include "integrator/transmittance.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "system/timer.h"

namespace glint {

TransparentShadows::TransparentShadows(const Scene& scene, const Stages& stages,
                                       const std::atomic<bool>& cancel, Scratch& scratch)
    : scene_(scene), stages_(stages), cancel_(cancel), scratch_(scratch) {
  if (!(scene.features & GLINT_FEATURE_TRANSPARENT)) return;
  constexpr size_t kMostLayers = kAtOnce * Layers::kMost, kRows = kMostLayers + kPad;
  hits_.resize(kMostLayers);
  layers_.reserve(kMostLayers);
  first_of_.resize(scene.materials.size() + 1);
  columns_.shares.reserve(kRows);
  if (scene.materials.has_dense) {
    columns_.narrows.resize(kRows);
    columns_.turns.reserve(kRows);
    for (size_t c = 0; c < 3; ++c) stage_.bent[c] = columns_.turns[c];
  }
  for (std::vector<uint32_t>* v : {&columns_.number, &columns_.instance, &columns_.primitive})
    v->resize(kRows);
  columns_.u.resize(kRows);
  columns_.v.resize(kRows);
  slots_.resize(size_t(scene.programs.most_slots) * kBlock);
  if (!scene.instances.only_meshes && (scene.materials.has_dense || !scene.programs.rows.empty()))
    columns_.solids.resize(8 * kRows);
  stage_.slots = slots_.data();
  stage_.tables = scene_.input_tables();
  stage_.shapes = scene_.instances.group_shapes.data();
  stage_.number = columns_.number.data();
  stage_.instance = columns_.instance.data();
  stage_.primitive = columns_.primitive.data();
  stage_.u = columns_.u.data();
  stage_.v = columns_.v.data();
  for (size_t c = 0; c < 3; ++c) stage_.share[c] = columns_.shares[c];
}

void TransparentShadows::begin(const ShadowRays& sent, LightShape shape, size_t count,
                               double* const (&shadow)[3], const Opacity* opacity,
                               uint32_t visibility) {
  sent_ = &sent;
  opacity_ = opacity;
  visibility_ = visibility;
  stage_.kind = visibility == kDiffuse  ? RayKind::kShadowScattered
                : visibility == kMirror ? RayKind::kShadowBounced
                                        : RayKind::kShadow;
  stage_.point = sent.point;
  for (size_t c = 0; c < 3; ++c) {
    stage_.origin[c] = sent.origin[c];
    stage_.start[c] = sent.start[c];
    stage_.to[c] = sent.to[c];
    shadow_[c] = shadow[c];
    stage_.end[c] = is_endless(shape) ? nullptr : sent.end[c];
    std::fill_n(shadow[c], count, 1.0);
  }
  waiting_.begin(count);
  bends_ = !is_dome(shape);
  if (scene_.materials.has_dense) {
    narrowed_.assign(count, 1.0);
    bent_.assign(count, Vec3d{});
  }
}

void TransparentShadows::trace(const ShadowRays& sent, LightShape shape, const Opacity* opacity,
                               const double* starts, size_t count, double* const (&shadow)[3],
                               RayCounts& counts, uint32_t visibility) {
  begin(sent, shape, count, shadow, opacity, visibility);
  counts.shadow += count;
  const double* const* o = sent.o;
  const double* const* d = sent.to;
  for (size_t k = 0; k < count && !cancel_; k += kAtOnce) {
    for (uint32_t i = 0; i < kAtOnce; ++i) ray_number_[i] = uint32_t(k) + i;
    pass({{o[0] + k, o[1] + k, o[2] + k},
          {d[0] + k, d[1] + k, d[2] + k},
          starts + k,
          sent.t_max + k,
          std::min(count - k, kAtOnce),
          visibility_,
          opacity_},
         counts);
  }
  go_on(counts);
  narrow(count);
}

void TransparentShadows::follow(const ShadowRays& sent, LightShape shape, const uint8_t* blocked,
                                size_t count, double* const (&shadow)[3], RayCounts& counts,
                                uint32_t visibility) {
  begin(sent, shape, count, shadow, scene_.trees.opacity(), visibility);
  for (uint32_t k = 0; k < count; ++k)
    if (blocked[k]) wait(k, 0);
  go_on(counts);
  narrow(count);
}

/// Rays that begin in what is dense see of the light outside what comes in a narrower cone; what a
/// body bends goes elsewhere.
void TransparentShadows::narrow(size_t count) {
  if (!scene_.materials.has_dense) return;
  for (size_t k = 0; k < count; ++k)
    for (double* column : shadow_) column[k] *= std::min(narrowed_[k], 1.0);
  for (size_t k = 0; bends_ && k < count; ++k) {
    const Vec3d d = row(sent_->to, k), across = bent_[k] - dot(bent_[k], d) * d;
    const bool is_out = std::fabs(narrowed_[k] - 1) < kAlike;
    if (is_out && dot(across, across) > kMostBent * kMostBent) set_row(shadow_, k, {});
  }
}

/// Adds a ray to those that look for layers beyond t_min.
void TransparentShadows::wait(uint32_t number, double t_min) {
  waiting_.add(number, sent_->o, sent_->to, number, t_min, sent_->t_max[number]);
}

void TransparentShadows::go_on(RayCounts& counts) {
  waiting_.trace(ray_number_, visibility_, opacity_, [&](const Rays& rays) {
    pass(rays, counts);
    if (cancel_) waiting_.drop();
  });
}

/// Some rays through their nearest layers.
void TransparentShadows::pass(const Rays& rays, RayCounts& counts) {
  {
    const Timer timer(counts.tracing);
    scene_.trees.accel().find_layers(rays, {hits_.data(), found_}, blocked_, scratch_);
  }
  bool dimmed = false;
  for (size_t k = 0; k < rays.count; ++k) {
    dimmed |= blocked_[k] == 1;
    if (blocked_[k] == 2) set_row(shadow_, ray_number_[k], {});
  }
  if (!dimmed) return;
  list_layers(rays);
  sort_layers();
  read_shares(rays);
  for (size_t k = 0; k < rays.count; ++k) multiply(k);
}

/// The layers that count: of those at one distance the first, as if rays started again behind it.
void TransparentShadows::list_layers(const Rays& rays) {
  layers_.clear();
  for (uint32_t k = 0; k < rays.count; ++k) {
    const uint32_t first = k * Layers::kMost,
                   count = blocked_[k] == 1 ? std::min<uint32_t>(found_[k], Layers::kMost) : 0;
    double t_min = rays.t_min[k];
    for (uint32_t i = first; i < first + count; ++i) {
      const Hit& hit = hits_[i];
      if (!(hit.t > t_min)) continue;
      t_min = beyond(hit.t);
      layers_.push_back(
          {i, scene_.instances.material_of(scene_.instances.group(hit.instance), hit.primitive),
           0});
    }
    end_[k] = uint32_t(layers_.size());
  }
}

/// To the columns of the stage, material by material.
void TransparentShadows::sort_layers() {
  materials_.clear();
  for (const Layer& layer : layers_)
    if (first_of_[layer.material]++ == 0) materials_.push_back(layer.material);
  uint32_t next = 0;
  for (uint32_t m : materials_) next += std::exchange(first_of_[m], next);
  for (Layer& layer : layers_) {
    const Hit& hit = hits_[layer.hit];
    const uint32_t row = layer.row = first_of_[layer.material]++;
    columns_.number[row] = ray_number_[layer.hit / Layers::kMost];
    columns_.instance[row] = hit.instance;
    columns_.primitive[row] = hit.primitive;
    columns_.u[row] = hit.u;
    columns_.v[row] = hit.v;
  }
}

/// Where rays met what is no mesh, as TransmittanceStage has it.
void TransparentShadows::place_solids(const Rays& rays) {
  for (const Layer& layer : layers_) {
    const Hit& hit = hits_[layer.hit];
    if (scene_.instances.geometry(scene_.instances.group(hit.instance)).kind == GLINT_MESH)
      continue;
    const uint32_t k = layer.hit / Layers::kMost;
    const Surface s = surface_at(scene_, {rays.o[0][k], rays.o[1][k], rays.o[2][k]},
                                 {rays.d[0][k], rays.d[1][k], rays.d[2][k]}, hit);
    double* solid = columns_.solids.data() + 8 * size_t(layer.row);
    for (int c = 0; c < 3; ++c) {
      solid[c] = s.x[c];
      solid[3 + c] = s.g[c];
    }
    solid[6] = s.outside ? 1 : 0;
    solid[7] = s.weights[1];
  }
}

/// What each layer lets through.
void TransparentShadows::read_shares(const Rays& rays) {
  const bool has_solids = !scene_.instances.only_meshes &&
                          (scene_.materials.has_dense || !scene_.programs.rows.empty());
  if (has_solids) place_solids(rays);
  stage_.solids = has_solids ? columns_.solids.data() : nullptr;
  size_t first = 0;
  for (uint32_t m : materials_) {
    const size_t end = std::exchange(first_of_[m], 0);
    const Material& material = scene_.materials[m];
    if (material.has(GLINT_TRANSPARENT)) {
      stage_.first = first;
      stage_.count = end - first;
      stage_.lobes = scene_.materials.lobes.data() + material.first_lobe;
      stage_.lobe_count = material.lobe_count;
      stage_.program = material.program > 0 ? scene_.programs.of(material.program) : nullptr;
      stage_.narrowed = material.is_dense ? columns_.narrows.data() : nullptr;
      stages_.transmit(stage_);
    } else {
      for (size_t c = 0; c < 3; ++c)
        std::fill(columns_.shares[c] + first, columns_.shares[c] + end, 0.0);
    }
    first = end;
  }
}

/// What is left of a ray's light behind its layers. Where there are more of them and it has light
/// left, it waits.
void TransparentShadows::multiply(size_t ray) {
  const uint32_t number = ray_number_[ray];
  Vec3d S = row(shadow_, number);
  const uint32_t end = end_[ray];
  const bool has_dense = scene_.materials.has_dense;
  for (uint32_t i = ray ? end_[ray - 1] : 0; i < end && any(S); ++i) {
    S = S * row({columns_.shares[0], columns_.shares[1], columns_.shares[2]}, layers_[i].row);
    if (has_dense && scene_.materials[layers_[i].material].is_dense) {
      narrowed_[number] *= columns_.narrows[layers_[i].row];
      bent_[number] +=
          row({columns_.turns[0], columns_.turns[1], columns_.turns[2]}, layers_[i].row);
    }
  }
  set_row(shadow_, number, S);
  if (found_[ray] > Layers::kMost && any(S)) wait(number, beyond(hits_[layers_[end - 1].hit].t));
}

}  // namespace glint
