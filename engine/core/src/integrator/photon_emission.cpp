#include "integrator/photon_emission.h"

#include <algorithm>
#include <cmath>

#include "math/math.h"

namespace glint {
namespace {

constexpr size_t kMostCasters = 64;  // of placements, then of what they are instances of
constexpr uint32_t kPlaces = 16;     // on lamps with an extent
constexpr double kBeyond = 4;        // of anchored space: more than anything of the scene is off

/// The fraction of 1/2 + i a: numbers of Kronecker's sequences, by the roots of x^(d+1) = x + 1
/// (Roberts 2018, The unreasonable effectiveness of quasirandom sequences), two and three of them.
double kronecker(uint32_t i, double a) {
  const double at = 0.5 + double(i) * a;
  return at - std::floor(at);
}
constexpr double kPlane[] = {0.7548776662466927, 0.5698402909980532},
                 kSpace[] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};

/// The square [0, 1)^2 to the unit disc (Shirley, Chiu 1997).
LightPoint on_disc(double u, double v) {
  const double a = 2 * u - 1, b = 2 * v - 1;
  LightPoint p;
  p.a = a;
  p.b = b;
  if (a == 0 && b == 0) return p;
  if (std::fabs(a) > std::fabs(b)) {
    const double angle = kPi / 4 * (b / a);
    p.x = a * cosine(angle);
    p.y = a * sine(angle);
  } else {
    const double angle = kPi / 4 * (a / b);
    p.x = b * sine(angle);
    p.y = b * cosine(angle);
  }
  return p;
}

/// The cone that a ball of radius r fills, seen from `distance` away, as 1 - cos of its half angle:
/// all directions from inside.
double versine_of(double r, double distance) {
  if (!(distance > r)) return 2;
  const double sine2 = (r / distance) * (r / distance);
  return sine2 / (1 + std::sqrt(1 - sine2));
}

Vec3d axis_to(Vec3d to) { return any(to) ? unit(to) : Vec3d{0, 0, 1}; }

bool is_sharp(const Scene& scene, const RenderPlan& plan, uint32_t material) {
  const Material& m = scene.materials[material];
  if (plan.reflective_caustics && m.has(GLINT_MIRROR)) return true;
  return plan.refractive_caustics && m.has(GLINT_REFRACTION) && !m.is_rough_glass;
}

bool is_caster(const Scene& scene, const RenderPlan& plan, const GlintInstances& group) {
  if (!(group.flags & GLINT_VISIBLE_SHADOW)) return false;
  if (scene.instances.geometry(group).kind == GLINT_STRANDS) return false;
  if (group.material_count == 0) return is_sharp(scene, plan, scene.instances.default_material);
  for (uint32_t k = 0; k < group.material_count; ++k)
    if (is_sharp(scene, plan, scene.instances.material_slots[group.first_material + k]))
      return true;
  return false;
}

/// At least by how much a matrix lengthens anything; just that where its columns are across each
/// other.
double larger_scale(const Affine& m) {
  const double xy = std::fabs(dot(m.x, m.y)), yz = std::fabs(dot(m.y, m.z)),
               zx = std::fabs(dot(m.z, m.x));
  return std::sqrt(
      std::max({dot(m.x, m.x) + xy + zx, dot(m.y, m.y) + xy + yz, dot(m.z, m.z) + yz + zx}));
}

/// About the middle of the box round it, of corners and of spheres with their radii.
Caster ball_round(const InstanceTable& all, uint32_t placement) {
  const GlintGeometry& geometry = all.geometry(all.group(placement));
  const Affine m = all.matrix(placement);
  Caster caster{placement, placement + 1, {}, 0};
  Extent box;
  const auto each = [&](auto body) {
    for (uint64_t i = 0; i < geometry.vertex_count; ++i) {
      const Vec3d p = vertex(geometry, i);
      const double r = geometry.radii ? geometry.radii[i] : 0;
      if (finite(p) && std::isfinite(r)) body(point(m, p), r * larger_scale(m));
    }
  };
  each([&](Vec3d p, double r) {
    box.grow(p - Vec3d{r, r, r});
    box.grow(p + Vec3d{r, r, r});
  });
  caster.center = 0.5 * (box.low + box.high);
  each([&](Vec3d p, double r) {
    caster.radius = std::max(caster.radius, length(p - caster.center) + r);
  });
  return caster;
}

/// A caster of several placements is a ball round theirs.
Caster merged(const Caster& a, const Caster& b) {
  const Vec3d to = b.center - a.center;
  const double distance = length(to);
  Caster all = a;
  all.first = std::min(a.first, b.first);
  all.last = std::max(a.last, b.last);
  if (distance + b.radius <= a.radius) return all;
  if (distance + a.radius <= b.radius) {
    all.center = b.center;
    all.radius = b.radius;
    return all;
  }
  all.radius = 0.5 * (distance + a.radius + b.radius);
  all.center = a.center + ((all.radius - a.radius) / distance) * to;
  return all;
}

}  // namespace

bool throws_photons(const Light& light) { return !light.is_dome() && !light.is_tabled(); }

std::vector<Caster> find_casters(const Scene& scene, const RenderPlan& plan) {
  const InstanceTable& all = scene.instances;
  std::vector<Caster> casters;
  std::vector<bool> is(all.groups.size());
  for (size_t g = 0; g < is.size(); ++g) is[g] = is_caster(scene, plan, all.groups[g]);
  for (uint32_t k = 0; k < all.placements.size(); ++k) {
    if (!is[all.placements[k].group]) continue;
    const Caster caster = ball_round(all, k);
    if (caster.radius > 0) casters.push_back(caster);  // else there is nothing of it
  }
  const auto merge = [&](auto same) {
    std::vector<Caster> fewer;
    for (const Caster& caster : casters)
      if (!fewer.empty() && same(fewer.back(), caster)) fewer.back() = merged(fewer.back(), caster);
      else fewer.push_back(caster);
    casters = std::move(fewer);
  };
  if (casters.size() > kMostCasters)
    merge([&](const Caster& a, const Caster& b) {
      return all.placements[a.first].group == all.placements[b.first].group;
    });
  if (casters.size() > kMostCasters) merge([](const Caster&, const Caster&) { return true; });
  return casters;
}

bool PhotonBeam::shines() const {
  if (!throws_photons(*light) || !light->lights_gloss()) return false;
  if (light->kind != GLINT_AREA) return true;
  return dot(caster->center - light->center, light->axis) > -caster->radius;
}

double PhotonBeam::power() const {
  const double color = mean(abs(light->color)), r = caster->radius;
  if (light->kind == GLINT_SUN) return color * kPi * r * r;
  const double distance = length(caster->center - light->center),
               cone = 2 * kPi * versine_of(r + light->radius, distance);
  return color * light->scale2 * cone / (4 * kPi);
}

double PhotonBeam::choice(uint32_t i) const { return kronecker(place * count + i, kSpace[0]); }

EmittedPhoton PhotonBeam::photon(uint32_t i) const {
  const uint32_t number = place * count + i;
  const LightPoint along = on_disc(kronecker(number, kPlane[0]), kronecker(number, kPlane[1])),
                   on = on_disc(kronecker(place, kPlane[0]), kronecker(place, kPlane[1]));
  const double each = 1.0 / (double(count) * places), r = caster->radius;
  EmittedPhoton photon;
  if (light->kind == GLINT_SUN) {
    photon.d = direction_in_cone(light->axis, light->versine, on);
    const Frame frame(photon.d);
    photon.o = caster->center + r * (along.x * frame.t1 + along.y * frame.t2) -
               (kBeyond + length(caster->center)) * photon.d;
    photon.share = each * r * r * 2 / (2 - light->versine);
    return photon;
  }
  photon.at = light->center;
  double wide = r, along_axis = 1;
  if (light->kind == GLINT_AREA) {
    const bool ellipse = light->flags & GLINT_ELLIPSE;
    photon.at += (ellipse ? on.x : on.a) * light->right + (ellipse ? on.y : on.b) * light->up;
  } else wide += light->radius;
  const Vec3d to = caster->center - photon.at;
  const double versine = versine_of(wide, length(to));
  photon.d = direction_in_cone(axis_to(to), versine, along);
  if (light->kind == GLINT_AREA) along_axis = 4 * std::max(0.0, dot(photon.d, light->axis));
  else if (light->radius > 0) {  // of a ball all rays of a direction pass a disc across it
    const Frame frame(photon.d);
    photon.at += light->radius * (on.x * frame.t1 + on.y * frame.t2);
  }
  photon.o = photon.at;
  photon.share = along_axis > 0 ? each * along_axis * light->along(photon.d, true) *
                                      (2 * kPi * versine) * light->scale2 / (4 * kPi * kPi)
                                : 0;
  return photon;
}

std::vector<PhotonBeam> find_beams(const Scene& scene, const RenderPlan& plan,
                                   const std::vector<Caster>& casters) {
  std::vector<PhotonBeam> beams;
  double sum = 0;
  for (const Light& light : scene.lights)
    for (const Caster& caster : casters) {
      PhotonBeam beam{&light, &caster, 0, light.extended ? kPlaces : 1};
      if (!beam.shines() || !(beam.power() > 0)) continue;
      for (; beam.place < beam.places; ++beam.place) beams.push_back(beam);
      sum += std::sqrt(beam.power());
    }
  for (PhotonBeam& beam : beams) {
    const double share = std::sqrt(beam.power()) / (sum * beam.places);
    beam.count = uint32_t(std::ceil(plan.photons * share));
  }
  return beams;
}

}  // namespace glint
