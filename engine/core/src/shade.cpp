// Letters: d ray direction, n shading normal, g geometric normal, T weight to the pixel, k coefficient of a lobe.
#include "shade.h"

#include <algorithm>

#include "math.h"

namespace glint {
namespace {

constexpr int kMaxStraight = 128;  // transparent rays in a row

/// The pass that a colour belongs to: what mirror and refraction rays bring is Mirror.
int part_of(const Path& path, int part) { return path.depth > 0 ? int(GLINT_PASS_MIRROR) : part; }

}  // namespace

/// A ray that arrives at a surface.
struct Shader::Incidence {
  const Ray& ray;
  const Path& path;
  const Surface& s;
  double cosine() const { return std::fabs(dot(ray.d, s.n)); }
  double relative(double ior) const { return s.outside ? ior : 1 / ior; }
};

void Shader::hit(const Ray& ray, const Path& path, double t, const Surface& s, const Material& material, Work& work, Queue& next) const {
  if (scene_.group(s.instance).flags & GLINT_HOLDOUT) return hold_out(path, s, material);
  Incidence at{ray, path, s};
  Lobes sum;
  sum.first_specular = uint32_t(work.specular.size());
  for (uint32_t i = 0; i < material.lobe_count; ++i) add_lobe(at, scene_.lobes[material.first_lobe + i], sum, work, next);
  if (path.wants_data && mean(sum.transparent) < 0.5) record(path, s, material);
  keep_lit(at, sum, work);
  go_on(at, sum, t, work, next);
}

void Shader::add_lobe(const Incidence& at, const Lobe& lobe, Lobes& sum, Work& work, Queue& next) const {
  Vec3d k = coefficient(scene_, lobe, at.s), Tk = at.path.T * k;
  double F = lobe.fresnel ? fresnel_reflectance(at.cosine(), at.relative(lobe.ior)) : 1;
  switch (lobe.kind) {
    case GLINT_AMBIENT: return film_.add(at.path.pixel, part_of(at.path, GLINT_PASS_AMBIENT), Tk * scene_.ambient);
    case GLINT_EMISSION: return film_.add(at.path.pixel, part_of(at.path, GLINT_PASS_EMISSION), Tk);
    case GLINT_DIFFUSE: sum.diffuse += k; return;
    case GLINT_SPECULAR: work.specular.push_back({k, lobe.exponent}); return;
    case GLINT_MIRROR: sum.mirror += F * k; return;
    case GLINT_REFRACTION: return refraction(at, lobe.fresnel ? (1 - F) * k : k, at.relative(lobe.ior), work, next);
    case GLINT_TRANSPARENT: sum.transparent += k; return;
  }
}

/// A ray that leaves the surface one bounce deeper.
bool Shader::push(const Incidence& at, Vec3d d, Vec3d k, Queue& next) const {
  Path path{at.path.T * k, at.s.x, 0, at.path.pixel, uint8_t(at.path.depth + 1), 0, false};
  if (!any(path.T) || path.depth > plan_.max_bounces) return false;
  next.push({leave(at.s, at.s.x, d), d, 0, kInfinity, kMirror}, path);
  return true;
}

void Shader::refraction(const Incidence& at, Vec3d k, double relative_ior, Work& work, Queue& next) const {
  Vec3d d = refract(at.ray.d, dot(at.ray.d, at.s.n) <= 0 ? at.s.n : at.s.g, relative_ior);
  if (any(d) && push(at, d, k, next)) ++work.counts.refraction;
}

void Shader::go_on(const Incidence& at, const Lobes& sum, double t, Work& work, Queue& next) const {
  if (any(sum.mirror) && push(at, reflect(at.ray.d, at.s.n, at.s.g), sum.mirror, next)) ++work.counts.mirror;
  if (!any(sum.transparent) || at.path.straight >= kMaxStraight) return;
  Path path = at.path;
  path.T = path.T * sum.transparent, path.from = t, ++path.straight;
  path.wants_data = path.wants_data && !(mean(sum.transparent) < 0.5);
  if (!any(path.T) && !path.wants_data) return;
  Ray ray = at.ray;
  ray.t_min = beyond(t);
  next.push(ray, path), ++work.counts.transparent;
}

void Shader::keep_lit(const Incidence& at, const Lobes& sum, Work& work) const {
  uint32_t count = uint32_t(work.specular.size()) - sum.first_specular;
  if (scene_.lights.empty() || (count == 0 && !any(sum.diffuse)) || !any(at.path.T)) return;
  work.lit.push_back({at.s, -at.ray.d, shadow_origin(scene_, at.s), at.path.T, sum.diffuse, at.path.pixel, sum.first_specular, count,
                      at.path.depth == 0});
}

void Shader::record(const Path& path, const Surface& s, const Material& material) const {
  Uv uv = film_.wants(GLINT_PASS_UV) ? uv_at(scene_, s, -1) : Uv{};
  double mapped = film_.wants(GLINT_PASS_UV) && has_uv(scene_, s) ? 1 : 0;
  film_.set_data(path.pixel, {camera_.depth(s.x), scene_.anchor.world(s.x), s.n, {uv.u, uv.v, mapped},
                              scene_.group(s.instance).object_index, material.index});
}

void Shader::hold_out(const Path& path, const Surface& s, const Material& material) const {
  if (path.wants_data && mean(transparency(scene_, material, s)) < 0.5) record(path, s, material);
  if (path.depth == 0) film_.lose_alpha(path.pixel, mean(path.T));
}

void Shader::miss(const Path& path) const {
  if (scene_.transparent_film && path.depth == 0) return film_.lose_alpha(path.pixel, mean(path.T));
  if (any(scene_.background)) film_.add(path.pixel, part_of(path, GLINT_PASS_ENVIRONMENT), path.T * scene_.background);
}

void Shader::seen_lights(const Ray& ray, const Path& path, double t) const {
  uint32_t flag = path.depth > 0 ? GLINT_SEEN_BY_MIRROR : GLINT_SEEN_BY_CAMERA;
  for (const Light& light : scene_.lights) {
    if (!(light.flags & flag)) continue;
    double meets = light.meets(ray.o, ray.d);
    bool before = light.endless() ? meets > 0 && t == kInfinity : meets > path.from && meets > ray.t_min && meets < std::min(t, ray.t_max);
    if (before) film_.add(path.pixel, part_of(path, GLINT_PASS_EMISSION), path.T * light.radiance(ray.d, plan_.physical));
  }
}

}  // namespace glint
