#include "integrator/transmittance.h"

#include "session/timer.h"

namespace glint {

void TransparentShadows::follow(const Batch& batch, const LightStage& light, const uint8_t* blocked,
                                size_t count, double* const (&shadow)[3], RayCounts& counts) {
  for (double* channel : shadow)
    for (size_t k = 0; k < count; ++k) channel[k] = blocked[k] == 2 ? 0 : 1;
  start(light, blocked, count);
  TransmittanceStage stage{};
  stage.tables = scene_.input_tables();
  stage.shapes = scene_.group_shapes.data(), stage.rays = rays_[0], stage.stride = rays_.stride(),
  stage.number = number_.data();
  stage.instance = instance_.data(), stage.primitive = primitive_.data(), stage.u = u_.data(),
  stage.v = v_.data();
  stage.point = light.point;
  stage.slots = slots_.data();
  for (size_t c = 0; c < 3; ++c) {
    stage.origin[c] = batch.points.origin[c], stage.to[c] = light.to[c],
    stage.shadow[c] = shadow[c];
    stage.end[c] = light.shape == kDirection ? nullptr : light.end_out[c];
  }
  while (open_ > 0 && !cancel_) find_hits(counts), open_ = step(stage);
}

/// All blocked rays, from their start.
void TransparentShadows::start(const LightStage& light, const uint8_t* blocked, size_t count) {
  rays_.reserve(count + kPad);
  for (std::vector<uint32_t>* v : {&number_, &instance_, &primitive_}) v->resize(rays_.rows());
  u_.resize(rays_.rows()), v_.resize(rays_.rows());
  open_ = 0;
  for (uint32_t k = 0; k < count; ++k)
    if (blocked[k] == 1) number_[open_++] = k;
  const auto take = [&](size_t column, const double* from) {
    for (size_t i = 0; i < open_; ++i) rays_[column][i] = from[number_[i]];
  };
  for (size_t c = 0; c < 3; ++c)
    take(TransmittedRay::kO + c, light.o[c]), take(TransmittedRay::kD + c, light.to[c]);
  take(TransmittedRay::kTMax, light.t_max);
  std::fill_n(rays_[TransmittedRay::kTMin], open_, 0.0);
}

void TransparentShadows::find_hits(RayCounts& counts) {
  const Timer timer(counts.tracing);
  const Columns& c = rays_;
  const Rays rays{{c[TransmittedRay::kO], c[TransmittedRay::kO + 1], c[TransmittedRay::kO + 2]},
                  {c[TransmittedRay::kD], c[TransmittedRay::kD + 1], c[TransmittedRay::kD + 2]},
                  c[TransmittedRay::kTMin],
                  c[TransmittedRay::kTMax],
                  open_,
                  kShadow,
                  scene_.opacity()};
  scene_.accel().closest(
      rays, {rays_[TransmittedRay::kT], instance_.data(), primitive_.data(), u_.data(), v_.data()},
      scratch_);
}

/// Of the hit of ray k; one beyond the last for none.
uint32_t TransparentShadows::material_at(size_t k) const {
  if (instance_[k] == Hit::kNone) return scene_.nothing();
  return scene_.material_of(scene_.group(instance_[k]), primitive_[k]);
}

/// One surface on the way of each ray. How many rays are left.
size_t TransparentShadows::step(TransmittanceStage& stage) {
  stage.kept = 0;
  for (size_t k = 0, end; k < open_; k = end) {
    const uint32_t material = material_at(k);
    for (end = k + 1; end < open_ && material_at(end) == material;) ++end;
    stage.first = k, stage.count = end - k;
    stage.kept = pass(stage, material);
  }
  return stage.kept;
}

/// Where rays met what is no mesh, as TransmittanceStage has it.
const double* TransparentShadows::place_shapes(const TransmittanceStage& met) {
  shapes_.resize(7 * met.stride);
  for (size_t k = met.first; k < met.first + met.count; ++k) {
    const Hit hit{rays_[TransmittedRay::kT][k], instance_[k], primitive_[k], u_[k], v_[k]};
    if (scene_.geometry(scene_.group(hit.instance)).kind == GLINT_MESH) continue;
    const auto of_ray = [&](size_t column) {
      return Vec3d{rays_[column][k], rays_[column + 1][k], rays_[column + 2][k]};
    };
    const Surface s =
        surface_at(scene_, of_ray(TransmittedRay::kO), of_ray(TransmittedRay::kD), hit);
    for (int c = 0; c < 3; ++c) {
      shapes_[size_t(c) * met.stride + k] = s.x[c];
      shapes_[size_t(3 + c) * met.stride + k] = s.g[c];
    }
    shapes_[6 * met.stride + k] = s.outside ? 1 : 0;
  }
  return shapes_.data();
}

/// The same for some that met one material, or nothing.
size_t TransparentShadows::pass(const TransmittanceStage& met, uint32_t material) {
  if (material == scene_.nothing()) return met.kept;
  if (scene_.materials[material].has(GLINT_TRANSPARENT)) {
    TransmittanceStage stage = met;
    stage.lobes = scene_.lobe_shapes.data() + scene_.materials[material].first_lobe;
    stage.lobe_count = scene_.materials[material].lobe_count;
    if (scene_.materials[material].program > 0) {
      stage.program = &scene_.program_of(scene_.materials[material]);
      stage.slots = met.slots;
      stage.solids = scene_.only_meshes ? nullptr : place_shapes(met);
    }
    return stages_.transmit(stage);
  }
  for (double* channel : met.shadow)
    for (size_t k = met.first; k < met.first + met.count; ++k) channel[met.number[k]] = 0;
  return met.kept;
}

}  // namespace glint
