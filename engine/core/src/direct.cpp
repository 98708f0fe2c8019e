// Letters: l direction to the light, v to the viewer, h half vector (unnormalised), I intensity, S shadow.
#include "direct.h"

#include "math.h"

namespace glint {

void DirectLight::illuminate(Work& work, uint32_t sample) {
  if (work.lit.empty()) return;
  for (const Light& light : scene_.lights) {
    uint32_t count = light.extended ? plan_.light_samples : 1;
    for (uint32_t j = 0; j < count && !cancel_; ++j) {
      connect(light, plan_.light_point(sample, j), count, work);
      if (connections_.empty()) continue;
      through_.assign(connections_.size(), Vec3d{1, 1, 1});
      if (light.casts_shadow()) find_shadows(), work.counts.shadow += rays_.size();
      add_to_film(work);
    }
  }
}

void DirectLight::connect(const Light& light, const LightPoint& p, uint32_t count, const Work& work) {
  connections_.clear(), rays_.clear(), segments_.clear();
  for (uint32_t i = 0; i < work.lit.size(); ++i) {
    const LitPoint& point = work.lit[i];
    LightSample sample;
    if (!light.sample(point.s.x, p, count, plan_.physical, sample)) continue;
    double cosine = dot(point.s.n, sample.l);
    if (!(cosine > 0)) continue;
    Vec3d TI = sample.factor * point.T * light.color, specular;
    for (uint32_t k = 0; k < point.specular_count; ++k) {
      const SpecularTerm& term = work.specular[point.first_specular + k];
      specular += highlight(point.s.n, point.v + sample.l, term.exponent) * term.k;
    }
    Connection connection{i, cosine * TI * point.k, TI * specular};
    if (!any(connection.diffuse) && !any(connection.specular)) continue;
    connections_.push_back(connection);
    if (light.casts_shadow()) shadow_ray(light, sample, point);
  }
}

/// The open segment from the point to the light's sample; its far end stops short of what the sample lies on.
void DirectLight::shadow_ray(const Light& light, const LightSample& sample, const LitPoint& point) {
  if (glassy_) segments_.push_back({point.origin, light.endless() ? sample.l : unit(sample.end - point.origin)});
  if (light.endless()) {
    rays_.push_back({leave(point.s, point.origin, sample.l), sample.l, 0, kInfinity, kShadow});
    return;
  }
  Vec3d o = leave(point.s, point.origin, sample.end - point.origin), to = sample.end - o;
  double far = length(to);
  rays_.push_back({o, unit(to), 0, far - rounding(std::max(max_abs(sample.end), max_abs(o))), kShadow});
}

void DirectLight::find_shadows() {
  blocked_.resize(rays_.size());
  scene_.accel().occluded(rays_.data(), blocked_.data(), rays_.size());
  open_.clear();
  for (uint32_t k = 0; k < rays_.size(); ++k) {
    if (!blocked_[k]) continue;
    if (glassy_) open_.push_back(k);
    else through_[k] = {};
  }
  if (glassy_) step_through_surfaces();
}

/// Follows blocked rays from surface to surface; each lets its clamped transparency through.
void DirectLight::step_through_surfaces() {
  while (!open_.empty() && !cancel_) {
    stepping_.clear();
    for (uint32_t k : open_) stepping_.push_back(rays_[k]);
    hits_.resize(stepping_.size());
    scene_.accel().closest(stepping_.data(), hits_.data(), stepping_.size());
    size_t kept = 0;
    for (size_t i = 0; i < open_.size(); ++i) {
      uint32_t k = open_[i];
      if (hits_[i].instance == Hit::kNone) continue;
      Surface s = surface_at(scene_, segments_[k].o, segments_[k].d, hits_[i]);
      const Material& material = scene_.materials[scene_.material_of(scene_.group(s.instance), s.primitive)];
      Vec3d clear = transparency(scene_, material, s);
      through_[k] = through_[k] * max(Vec3d{}, min(Vec3d{1, 1, 1}, clear));
      rays_[k].t_min = beyond(hits_[i].t);
      if (any(through_[k])) open_[kept++] = k;
    }
    open_.resize(kept);
  }
}

void DirectLight::add_to_film(const Work& work) {
  bool parts = film_.wants_light_parts();
  for (size_t k = 0; k < connections_.size(); ++k) {
    const Connection& c = connections_[k];
    const LitPoint& point = work.lit[c.point];
    Vec3d full = c.diffuse + c.specular, lit = full * through_[k];
    if (!point.primary) { film_.add(point.pixel, GLINT_PASS_MIRROR, lit); continue; }
    film_.add_only(point.pixel, GLINT_PASS_COMBINED, lit);
    if (!parts) continue;
    film_.add_only(point.pixel, GLINT_PASS_DIFFUSE, c.diffuse);
    film_.add_only(point.pixel, GLINT_PASS_SPECULAR, c.specular);
    film_.add_only(point.pixel, GLINT_PASS_SHADOW, lit - full);
  }
}

}  // namespace glint
