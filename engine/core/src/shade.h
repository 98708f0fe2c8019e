// Lobes of a batch of hits: what they add to the film, which points want light, which rays go on (notes 4.12-4.17).
#pragma once
#include <vector>

#include "camera.h"
#include "film.h"
#include "plan.h"
#include "queue.h"
#include "scene.h"
#include "surface.h"

namespace glint {

struct SpecularTerm {
  Vec3d k;
  double exponent;
};

/// A point that lights may reach. k: sum of the DIFFUSE lobes; its SPECULAR lobes are `specular_count` terms from `first_specular` on.
struct LitPoint {
  Surface s;
  Vec3d v, origin, T, k;
  uint32_t pixel = 0, first_specular = 0, specular_count = 0;
  bool primary = true;  // at depth 0
};

/// What the shading of a batch leaves to be done.
struct Work {
  std::vector<LitPoint> lit;
  std::vector<SpecularTerm> specular;
  RayCounts counts;
  void clear() { lit.clear(), specular.clear(); }
};

class Shader {
 public:
  Shader(const Scene& scene, const RenderPlan& plan, Film& film) : scene_(scene), plan_(plan), film_(film), camera_(scene) {}

  /// A ray that hit something. Rays that go on are pushed to `next`.
  void hit(const Ray& ray, const Path& path, double t, const Surface& s, const Material& material, Work& work, Queue& next) const;
  void miss(const Path& path) const;
  /// Adds the visible shapes of lights that the ray meets before t.
  void seen_lights(const Ray& ray, const Path& path, double t) const;

 private:
  struct Lobes {
    Vec3d diffuse, mirror, transparent;
    uint32_t first_specular = 0;
  };
  struct Incidence;
  void add_lobe(const Incidence& at, const Lobe& lobe, Lobes& sum, Work& work, Queue& next) const;
  void go_on(const Incidence& at, const Lobes& sum, double t, Work& work, Queue& next) const;
  void refraction(const Incidence& at, Vec3d k, double relative_ior, Work& work, Queue& next) const;
  bool push(const Incidence& at, Vec3d d, Vec3d k, Queue& next) const;
  void keep_lit(const Incidence& at, const Lobes& sum, Work& work) const;
  void record(const Path& path, const Surface& s, const Material& material) const;
  void hold_out(const Path& path, const Surface& s, const Material& material) const;

  const Scene& scene_;
  const RenderPlan& plan_;
  Film& film_;
  CameraRays camera_;
};

}  // namespace glint
