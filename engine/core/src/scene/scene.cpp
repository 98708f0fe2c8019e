#include "scene/scene.h"

#include <algorithm>

#include "math/math.h"
#include "scene/panorama_step.h"

namespace glint {
namespace {

/// 2^-k for a radius in [2^k, 2^(k+1)); exponents beyond 200 would only make squares overflow.
double power_scale(double radius) {
  if (!(radius > 0 && radius < kInfinity)) return 1;
  return power_of_two(-std::clamp(std::ilogb(radius), -200, 200));
}

ProgramView program_view(const GlintCamera& camera, const Anchor& anchor) {
  const Affine m = affine(camera.world_from_camera);
  const Vec3d axes[3] = {m.x, m.y, m.z};
  ProgramView view{};
  for (int c = 0; c < 3; ++c) {
    view.origin[c] = anchor.origin[c];
    view.eye[c] = m.t[c];
    for (int k = 0; k < 3; ++k) view.axes[k][c] = axes[k][c];
  }
  view.scale = anchor.scale;
  view.parallel = camera.kind == GLINT_ORTHOGRAPHIC;
  view.clip_start = camera.clip_start;
  view.convergence = camera.eye_offset != 0 ? camera.convergence : kInfinity;
  std::copy_n(camera.window, 4, view.window);
  view.panorama = camera.kind == GLINT_PANORAMA ? &camera : nullptr;
  view.step = view.panorama
                  ? panorama_step(camera)
                  : 0.1 * length(m.x) * (camera.window[1] - camera.window[0]) / camera.width;
  return view;
}

uint32_t features_of(const GlintInstances& group, const Scene& scene) {
  uint32_t features = 0;
  if (group.flags & GLINT_HOLDOUT) features |= GLINT_FEATURE_HOLDOUT;
  if (group.flags & GLINT_CATCHER) features |= GLINT_FEATURE_SHADOW_CATCHER;
  if (scene.instances.geometry(group).normals.values) features |= GLINT_FEATURE_SMOOTH_NORMALS;
  for (uint32_t k = 0; k < group.material_count; ++k) {
    const Material& material =
        scene.materials[scene.instances.material_slots[group.first_material + k]];
    if (material.has(GLINT_MIRROR)) features |= GLINT_FEATURE_MIRROR;
    if (material.has(GLINT_REFRACTION)) features |= GLINT_FEATURE_REFRACTION;
    if (material.has(GLINT_TRANSPARENT)) features |= GLINT_FEATURE_TRANSPARENT;
    if (material.has(GLINT_HOLDOUT_LOBE)) features |= GLINT_FEATURE_HOLDOUT;
  }
  return features;
}

uint32_t features_of(const Light& light) {
  uint32_t features = 0;
  if (light.is_dome()) features |= GLINT_FEATURE_WORLD_LIGHT;
  else if (light.is_mesh()) features |= GLINT_FEATURE_MESH_LIGHT;
  else if (light.is_medium()) features |= GLINT_FEATURE_MEDIUM_LIGHT;
  else if (light.extended) features |= GLINT_FEATURE_SOFT_LIGHTS;
  if (light.flags & (GLINT_SEEN_BY_CAMERA | GLINT_SEEN_BY_MIRROR | GLINT_SEEN_BY_TRANSMISSION) &&
      any(light.seen))
    features |= GLINT_FEATURE_VISIBLE_LIGHTS;
  return features;
}

uint32_t features_of(const Scene& scene) {
  uint32_t features = 0;
  // Shadows have colours where media dim light.
  if (scene.media.world >= 0 || !scene.media.enclosures.empty())
    features |= GLINT_FEATURE_MEDIA | GLINT_FEATURE_TRANSPARENT |
                (scene.media.varies ? GLINT_FEATURE_VARIED_MEDIA : 0);
  for (const GlintInstances& group : scene.instances.groups) features |= features_of(group, scene);
  for (const Light& light : scene.lights) features |= features_of(light);
  if (!scene.programs.rows.empty()) features |= GLINT_FEATURE_NODE_PROGRAMS;
  if (!scene.materials.textures.empty()) features |= GLINT_FEATURE_TEXTURES;
  return features;
}

bool same_normals(const InstanceTable& here, const InstanceTable& there) {
  const auto same = [](const GlintGeometry& a, const GlintGeometry& b) {
    return a.normals.values == b.normals.values && a.normals.domain == b.normals.domain &&
           a.corners == b.corners;
  };
  return std::equal(here.geometries.begin(), here.geometries.end(), there.geometries.begin(),
                    there.geometries.end(), same);
}

}  // namespace

Scene::Scene(const GlintSceneData& data, const Scene* base, bool exact)
    : camera(data.camera),
      aov_count(uint32_t(data.aov_count)),
      light_group_count(uint32_t(data.light_group_count)),
      programs(copy_programs(data)),
      world(world_of(data, programs)),
      materials(compile_materials(data, world)),
      instances(copy_instances(data)) {
  std::vector<uint32_t> geometry_there;
  if (base) {
    geometry_there = same_geometries(data, *base);
    trees.begin_like(*base, geometry_there, exact);
  }
  const Vec3d eye = affine(camera.world_from_camera).t;
  const bool stays = !exact && trees.earlier() && trees.earlier()->near(eye);
  anchor.origin = stays ? trees.earlier()->origin : eye;
  const InstanceTable* const there = base ? &base->instances : nullptr;
  place_instances(instances, anchor.origin,
                  base && anchor.same_origin(base->anchor) ? there : nullptr);
  anchor.scale = stays ? trees.earlier()->scale
                       : power_scale(radius(instances, anchor.origin, there, geometry_there));
  shape_instances(instances, anchor, materials, base && anchor == base->anchor ? there : nullptr);
  lights = place_lights(data, anchor, programs);
  media = place_media(data, anchor, programs, materials, instances);
  view = program_view(camera, anchor);
  features = features_of(*this);
  if (features & GLINT_FEATURE_MESH_LIGHT) hide_emission(materials);
  if (base && trees.share(*this, *base, geometry_there, exact) &&
      same_normals(instances, base->instances))
    first_hits.share(base->first_hits);
}

}  // namespace glint
