// Letters: d ray direction, n shading normal, g geometric normal, T weight to the pixel, k coefficient of a lobe.
#include "shade.h"

#include <algorithm>

#include "math.h"

namespace glint {
namespace {

constexpr int kMaxStraight = 128;  // transparent rays in a row

}  // namespace

/// A ray that arrives at a surface.
struct Shader::Incidence {
  Ray ray;
  Path path;
  Surface s;
  double cosine() const { return std::fabs(dot(ray.d, s.n)); }
  double relative(double ior) const { return s.outside ? ior : 1 / ior; }
};

/// Sums of the lobes of a kind.
struct Shader::Passing {
  Vec3d mirror, transparent;
};

void Shader::pass_on(const Batch& batch, size_t k, Film& film, uint32_t pixel, const Leaving& next, RayCounts& counts) const {
  const Material& material = scene_.materials[batch.material[k]];
  bool passes = batch.queue->wants_data[k] != 0;
  for (int i = 0; !passes && i < material.passing; ++i) passes = any(batch.passing(k, i));
  if (!passes) return;
  const Incidence at{batch.queue->ray(k), batch.queue->path(k), batch.surface(k)};
  Passing sum;
  const Lobe* lobe = scene_.lobes.data() + material.first_lobe;
  for (int i = 0; i < material.passing; ++lobe)
    if (1u << lobe->kind & kPassing) add_lobe(at, *lobe, batch.passing(k, i++), sum, next, counts);
  if (at.path.wants_data && mean(sum.transparent) < 0.5) record(film, pixel, at.s, material, at.ray.d);
  go_on(at, sum, batch.t[k], next, counts);
}

void Shader::add_lobe(const Incidence& at, const Lobe& lobe, Vec3d k, Passing& sum, const Leaving& next, RayCounts& counts) const {
  const double F = lobe.fresnel ? fresnel_reflectance(at.cosine(), at.relative(lobe.ior)) : 1;
  if (lobe.kind == GLINT_MIRROR) sum.mirror += F * k;
  else if (lobe.kind == GLINT_REFRACTION) refraction(at, lobe.fresnel ? (1 - F) * k : k, at.relative(lobe.ior), next, counts);
  else sum.transparent += k;
}

void Shader::hold_out(const Batch& batch, size_t k, Film& film, uint32_t pixel, double& lost) const {
  const Path path = batch.queue->path(k);
  const Surface s = batch.surface(k);
  const Material& material = scene_.materials[scene_.material_of(scene_.group(s.instance), s.primitive)];
  if (path.wants_data && mean(transparency(scene_, material, s)) < 0.5) record(film, pixel, s, material, batch.queue->ray(k).d);
  if (path.depth == 0) lost += mean(path.T);
}

/// A ray that leaves the surface one bounce deeper.
bool Shader::push(const Incidence& at, Vec3d d, Vec3d k, Queue& next) const {
  const Path path{at.path.T * k, at.s.x, 0, at.path.slot, uint8_t(at.path.depth + 1), 0, false};
  if (!any(path.T) || path.depth > plan_.max_bounces) return false;
  if (std::max({std::fabs(path.T.x), std::fabs(path.T.y), std::fabs(path.T.z)}) < plan_.cutoff) return false;
  next.push({leave(at.s, at.s.x, d), d, 0, kInfinity, kMirror}, path);
  return true;
}

void Shader::refraction(const Incidence& at, Vec3d k, double relative_ior, const Leaving& next, RayCounts& counts) const {
  const Vec3d d = refract(at.ray.d, dot(at.ray.d, at.s.n) <= 0 ? at.s.n : at.s.g, relative_ior);
  if (any(d) && push(at, d, k, next.bounced)) ++counts.refraction;
}

void Shader::go_on(const Incidence& at, const Passing& sum, double t, const Leaving& next, RayCounts& counts) const {
  const bool bounces = any(sum.mirror) && at.path.depth < plan_.max_bounces;
  if (bounces && push(at, reflect(at.ray.d, at.s.n, at.s.g), sum.mirror, next.bounced)) ++counts.mirror;
  if (!any(sum.transparent) || at.path.straight >= kMaxStraight) return;
  Path path = at.path;
  path.T = path.T * sum.transparent, path.from = t, ++path.straight;
  path.wants_data = path.wants_data && !(mean(sum.transparent) < 0.5);
  if (!any(path.T) && !path.wants_data) return;
  Ray ray = at.ray;
  ray.t_min = beyond(t);
  next.straight.push(ray, path), ++counts.transparent;
}

void Shader::record(const Batch& batch, size_t k, Film& film, uint32_t pixel) const {
  const Surface s = batch.surface(k);
  record(film, pixel, s, scene_.materials[batch.material[k]], batch.queue->ray(k).d);
}

void Shader::record(Film& film, uint32_t pixel, const Surface& s, const Material& material, Vec3d d) const {
  Uv uv = film.wants(GLINT_PASS_UV) ? uv_at(scene_, s, -1) : Uv{};
  double mapped = film.wants(GLINT_PASS_UV) && has_uv(scene_, s) ? 1 : 0;
  film.set_data(pixel, {camera_.depth(s.x), std::fabs(dot(s.n, d)), scene_.anchor.world(s.x), s.n, {uv.u, uv.v, mapped},
                        scene_.group(s.instance).object_index, material.index});
}

void Shader::seen_lights(Batch& batch, size_t k) const {
  const Ray ray = batch.queue->ray(k);
  const Path path = batch.queue->path(k);
  const double t = batch.missed(k) ? kInfinity : batch.t[k];
  uint32_t flag = path.depth > 0 ? GLINT_SEEN_BY_MIRROR : GLINT_SEEN_BY_CAMERA;
  for (const Light& light : scene_.lights) {
    if (!(light.flags & flag)) continue;
    double meets = light.meets(ray.o, ray.d);
    bool before = light.endless() ? meets > 0 && t == kInfinity : meets > path.from && meets > ray.t_min && meets < std::min(t, ray.t_max);
    if (before) batch.add(k, batch.sums.emission, path.T * light.radiance(ray.d, plan_.physical));
  }
}

}  // namespace glint
