// The scene behind the C API: copied tables, borrowed arrays, everything checked, placed relative
// to the camera.
#pragma once
#include <string>
#include <vector>

#include "glint.h"
#include "scene/anchor.h"
#include "scene/first_hit_caches.h"
#include "scene/instances.h"
#include "scene/light.h"
#include "scene/materials.h"
#include "scene/medium.h"
#include "scene/programs.h"
#include "scene/trees.h"
#include "shading/stages.h"

namespace glint {

struct Scene;

/// What is wrong with the tables and arrays, one sentence a line; empty when they are sound.
std::string scene_problems(const GlintSceneData& data);

/// The same next to a scene without problems: geometries that are its own were checked before.
std::string scene_problems(const GlintSceneData& data, const Scene& base);

/// Of each geometry, the number of the one in `base` with the same arrays; AccelBase::kNone for
/// others.
std::vector<uint32_t> same_geometries(const GlintSceneData& data, const Scene& base);

/// Whether all that is checked of a geometry was checked of one in `base`: it has the same arrays,
/// attributes included.
bool same_attributes(const GlintSceneData& data, const GlintGeometry& g, const Scene& base,
                     const GlintGeometry& there);

struct Scene {
  /// `data` has no problems. base: a scene whose trees serve where nothing changed.  exact: the
  /// picture has the bits that it has without a base; else the coordinates of `base` stay as long
  /// as they are fine enough for the camera, and what moved gets trees of its own.
  explicit Scene(const GlintSceneData& data, const Scene* base = nullptr, bool exact = true);

  /// Makes the trees unless they are there; false when `cancel` became true.
  bool build(int threads, BuildQuality quality, const std::atomic<bool>& cancel) {
    return trees.build(*this, threads, quality, cancel);
  }
  InputTables input_tables() const {
    return {&view,
            &instances.values,
            instances.shapes.data(),
            instances.groups.data(),
            instances.geometries.data(),
            instances.attributes.data(),
            materials.inputs.data(),
            materials.reads.data(),
            materials.textures.data()};
  }

  GlintCamera camera;
  uint32_t aov_count, light_group_count;
  ProgramTable programs;
  World world;
  MaterialTable materials;
  InstanceTable instances;
  Anchor anchor;
  LightTable lights;
  MediaTable media;
  uint32_t features = 0;  // GLINT_FEATURE_*
  ProgramView view{};
  SceneTrees trees;
  FirstHitCaches first_hits;  // of this scene and those whose trees it has
};

}  // namespace glint
