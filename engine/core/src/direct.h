// Light that reaches points straight from the lights: unshadowed terms, shadow rays, and both to the film (notes 4.12-4.16).
#pragma once
#include <atomic>
#include <vector>

#include "shade.h"

namespace glint {

class DirectLight {
 public:
  DirectLight(const Scene& scene, const RenderPlan& plan, Film& film, const std::atomic<bool>& cancel)
      : scene_(scene), plan_(plan), film_(film), cancel_(cancel), glassy_(scene.features & GLINT_FEATURE_TRANSPARENT) {}

  /// Adds all lights to the points of `work`, for pixel sample `sample`.
  void illuminate(Work& work, uint32_t sample);

 private:
  /// A light sample that gives something to a point: T k I terms before shadows.
  struct Connection {
    uint32_t point;
    Vec3d diffuse, specular;
  };
  struct Segment {
    Vec3d o, d;
  };
  void connect(const Light& light, const LightPoint& p, uint32_t count, const Work& work);
  void shadow_ray(const Light& light, const LightSample& sample, const LitPoint& point);
  void find_shadows();
  void step_through_surfaces();
  void add_to_film(const Work& work);

  const Scene& scene_;
  const RenderPlan& plan_;
  Film& film_;
  const std::atomic<bool>& cancel_;
  const bool glassy_;  // some surface lets light through
  std::vector<Connection> connections_;
  std::vector<Ray> rays_, stepping_;  // one shadow ray a connection; those on their way through transparent surfaces
  std::vector<Segment> segments_;     // the same as rays_, not moved clear of the surface: transparent surfaces are met from there
  std::vector<uint8_t> blocked_;
  std::vector<uint32_t> open_;        // connections of `stepping_`
  std::vector<Hit> hits_;
  std::vector<Vec3d> through_;        // the shadow S of each connection
};

}  // namespace glint
