// The scene behind the door: copied tables, borrowed arrays, everything checked, placed relative to
// the camera.
#pragma once
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "bvh/accel.h"
#include "glint.h"
#include "math/vec.h"
#include "scene/light.h"
#include "scene/material.h"
#include "scene/medium.h"
#include "shading/stages.h"

namespace glint {

/// Anchored space: the camera is the origin, and a power of two brings the scene's radius to [1,
/// 2). Both steps keep all bits that matter (NUMERICS: far from the origin).
struct Anchor {
  Vec3d origin;
  double scale = 1;
  Vec3d point(Vec3d world) const { return scale * (world - origin); }
  Vec3d world(Vec3d p) const { return (1 / scale) * p + origin; }
  Affine matrix(const Affine& m) const {
    return {scale * m.x, scale * m.y, scale * m.z, point(m.t)};
  }
  /// Whether single precision is fine enough for an eye that stands there: not far out of the
  /// scene.
  bool near(Vec3d world_eye) const {
    return max_abs(point(world_eye)) <= 4;
  }  // the scene's radius is 1 to 2
  bool same_origin(const Anchor& b) const {
    return origin.x == b.origin.x && origin.y == b.origin.y && origin.z == b.origin.z;
  }
  bool operator==(const Anchor& b) const { return same_origin(b) && scale == b.scale; }
};

/// How much mist lies before what is at some distance from the eye.
struct Mist {
  double start = 0, per_length = 0;
  int falloff = GLINT_MIST_LINEAR;
  double at(double distance) const {
    const double x = std::fmin(std::fmax((distance - start) * per_length, 0), 1);
    return falloff == GLINT_MIST_QUADRATIC ? x * x
           : falloff == GLINT_MIST_LINEAR  ? x
                                           : std::sqrt(x);
  }
};

/// What is wrong with the tables and arrays, one sentence a line; empty when they are sound.
std::string scene_problems(const GlintSceneData& data);

class Film;
class OpacityMaps;
class PassedInstances;
class Scene;
class FirstHitCache;
struct RenderPlan;

/// The same next to a scene without problems: geometries that are its own were checked before.
std::string scene_problems(const GlintSceneData& data, const Scene& base);

/// Of each geometry, the number of the one in `base` with the same arrays; AccelBase::kNone for
/// others.
std::vector<uint32_t> same_geometries(const GlintSceneData& data, const Scene& base);

/// Whether all that is checked of a geometry was checked of one in `base`: it has the same arrays,
/// attributes included.
bool same_attributes(const GlintSceneData& data, const GlintGeometry& g, const Scene& base,
                     const GlintGeometry& there);

/// Low and high corner; low above high for nothing.
struct Extent {
  Vec3d low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  void grow(Vec3d p) {
    low = min(low, p);
    high = max(high, p);
  }
  bool empty() const { return !(low.x <= high.x); }
  /// One of the 8.
  Vec3d corner(int k) const {
    return {k & 1 ? high.x : low.x, k & 2 ? high.y : low.y, k & 4 ? high.z : low.z};
  }
};

class Scene {
 public:
  /// `data` has no problems. base: a scene whose trees serve where nothing changed.  exact: the
  /// picture has the bits that it has without a base; else the coordinates of `base` stay as long
  /// as they are fine enough for the camera, and what moved gets trees of its own.
  explicit Scene(const GlintSceneData& data, const Scene* base = nullptr, bool exact = true);
  ~Scene();

  /// Makes the trees unless they are there; false when `cancel` became true.
  bool build(int threads, BuildQuality quality, const std::atomic<bool>& cancel);
  const Accel& accel() const { return *accel_; }
  /// Of a mesh light alone; where highlights draw directions. After build().
  const Accel& emitter_accel(const Light& light) const {
    return *emitter_accels_[light.mesh_number];
  }
  /// Of what encloses media alone: instance k is that of enclosure k. Where there are any, after
  /// build().
  const Accel& media_accel() const { return *media_accel_; }
  /// Where rays pass surfaces without a stop; null where nothing lets light through. After build().
  const Opacity* opacity() const;
  /// The same for the shadow rays of one of `lights`.
  const Opacity* opacity(const Light& light) const;
  /// The same where catchers alone cast shadows; in scenes that have some.
  const Opacity* opacity_of_catchers(const Light& light) const;
  /// What is known of the first wave of such a render, by this scene or those whose trees it has;
  /// nothing as yet for one that is new.
  std::shared_ptr<FirstHitCache> first_hits(const RenderPlan& plan, const Film& film);

  const double* matrix_row(uint32_t row) const { return world_from_object + 12 * size_t(row); }
  Affine anchored(uint32_t row) const { return anchor.matrix(affine(matrix_row(row))); }
  const GlintInstances& group(uint32_t instance) const {
    return groups[placements[instance].group];
  }
  const GlintGeometry& geometry(const GlintInstances& group) const {
    return geometries[group.geometry];
  }
  /// The instance's matrix to anchored space.
  Affine matrix(uint32_t instance) const;
  NormalMatrix normal_matrix(uint32_t instance) const;
  /// The material of a primitive; the last one of `materials` is the default surface.
  uint32_t material_of(const GlintInstances& group, uint32_t primitive) const;

  GlintCamera camera;
  Anchor anchor;
  Vec3d ambient, background;
  bool transparent_film = false;
  Mist mist;
  double occlusion_distance = 0;  // in world units
  uint32_t aov_count = 0, light_group_count = 0;
  int world_light_group = -1;  // of the surroundings; -1 for none
  std::vector<GlintGeometry> geometries;
  std::vector<GlintAttribute> attributes;
  std::vector<GlintInstances> groups;
  std::vector<uint32_t> material_slots;
  std::vector<Placement> placements;
  std::vector<TextureShape> textures;
  std::vector<ProgramShape> programs;
  std::vector<GlintInput> inputs;
  std::vector<LobeShape> lobes;
  std::vector<Material> materials;
  std::vector<Light> lights;
  std::vector<GlintEmitter> emitters;
  const double* world_from_object = nullptr;
  std::vector<Medium> media;                             // in anchored space
  std::vector<Enclosure> enclosures;                     // instances with a medium inside
  int32_t world_medium = -1;                             // what is everywhere
  bool scatters = false, emits = false, varies = false;  // some medium of these does
  InstanceShape world_space{};  // the world's axes, as programs read those of an object
  uint32_t features = 0;        // GLINT_FEATURE_*
  int max_specular = 0;         // SPECULAR, SHEEN and FIBRE lobes of a material, at most
  double most_exponent = 0;     // of SPECULAR lobes
  // SPECULAR lobes of GGX's masking, and which
  bool has_metals = false, has_varnish = false, has_gloss = false;
  bool has_rough_glass = false, has_fibre = false,
       has_sheen = false;    // SHEEN or FIBRE lobes
  int specular_columns = 4;  // numbers of each as the stages read them
  int max_view = 0;          // lobes of a material that depend on the view, at most
  int max_passing = 0;       // Material::passing, at most
  int passing_columns = PassingTerm::kPlain;  // of each of these lobes
  uint32_t most_slots = 0;                    // of programs
  bool asks_rays = false;                     // some program does
  bool bends_normals = false;                 // some material gives shading normals of its own
  bool shadows_bumps = false;                 // and hides light by them
  bool turns_lobes = false;                   // some SPECULAR lobe may have a normal of its own
  /// Of a material that has one.
  const ProgramShape& program_of(const Material& m) const {
    return programs[size_t(m.program - 1)];
  }
  const ProgramShape* sky_program = nullptr;  // what rays see that hit nothing; null: background
  size_t sky_slot = 0;                        // in the block of its slots
  Vec3d sky_axes[3];                          // its axes in the scene
  size_t triangles = 0, primitives = 0, dropped_instances = 0, dropped_lights = 0;
  double build_seconds = 0;

  // The same for the stages. Numbers beyond those of the materials are of points without one: rays
  // that see the surroundings or, with a transparent film, nothing, and points of holdouts.
  uint32_t surroundings() const { return uint32_t(materials.size()); }
  uint32_t nothing() const { return uint32_t(materials.size()) + 1; }
  uint32_t holdout() const { return uint32_t(materials.size()) + 2; }
  std::vector<GroupShape> group_shapes;
  std::vector<InstanceShape> instance_shapes;
  std::vector<MaterialTerms> material_terms;
  std::vector<MaterialTerms> reflected_terms;  // as rays see them that rough surfaces reflect
  std::vector<double> specular_terms;  // max_specular rows of specular_columns numbers a material
  std::vector<double> view_terms;      // max_view rows of ViewTerm::kColumns a material
  InputTables input_tables() const {
    return {&program_view, &instance_values,  instance_shapes.data(),
            groups.data(), geometries.data(), attributes.data(),
            inputs.data(), reads.data(),      textures.data()};
  }
  ProgramView program_view{};
  InstanceValues instance_values{};
  std::vector<uint32_t> reads;  // for each input, the first of its material (or that itself) that
                                // reads the same of an image
  bool only_meshes = true;

 private:
  void copy_tables(const GlintSceneData& data);
  void copy_programs(const GlintSceneData& data);
  void set_program_view();
  void compile_materials(const GlintSceneData& data);
  void add_material(const GlintMaterial& material, const GlintLobe* given);
  void add_lobe(const GlintLobe& lobe);
  void compare_lobes(Material& material);
  void number_reads(const Material& material);
  bool same_inputs(size_t a, size_t b) const;
  bool stands(const Scene* base, size_t i) const;
  void place_instances(const Scene* base);
  void place_lights(const GlintLight* lights, size_t count);
  void place_media(const GlintSceneData& data);
  void note_features();
  void shape_groups();
  void shape_instances(const Scene* base);
  void fold_materials();
  void count_passing();
  double radius(const Scene* base);
  void reuse_from(const Scene& base, const GlintSceneData& data, bool exact);
  void share_trees(const Scene& base, bool exact);
  void share_emitters(const Scene& base);
  bool same_placements(const Scene& base) const;
  std::vector<const Light*> mesh_lights() const;
  bool build_emitters(int threads, const std::atomic<bool>& cancel);
  bool build_media(int threads, const std::atomic<bool>& cancel);
  std::vector<GeometryView> geometry_views() const;
  std::vector<InstanceView> instance_views() const;

  /// Trees of an earlier scene, and where its coordinates are.
  struct Earlier {
    AccelBase trees;
    Anchor anchor;
  };
  Earlier trees() const;

  std::vector<int32_t> program_words_;
  std::vector<double> program_constants_, program_tables_;
  std::vector<uint32_t> geometry_in_base_;
  std::vector<Extent> extents_;  // of the geometries, object space
  std::shared_ptr<const Accel> accel_, media_accel_;
  std::vector<std::shared_ptr<const Accel>> emitter_accels_;  // of the mesh lights
  const float* emitter_corners_ = nullptr;
  std::shared_ptr<const std::vector<uint32_t>> emitter_rows_;  // of the corners, three an emitter
  std::unique_ptr<const OpacityMaps> opacity_;
  std::vector<std::unique_ptr<const PassedInstances>> passed_,
      caught_;  // by light; null: of most. caught_: all but catchers; the last one: of those most
  bool exact_ = true;  // accel_ is what a scene without a base would have
  Earlier earlier_;    // until there is accel_
  std::vector<std::shared_ptr<FirstHitCache>> first_hit_caches_;  // the last ones, newest first
  mutable std::mutex build_mutex_;
};

}  // namespace glint
