// Geometries and where they stand: copied tables, borrowed arrays, and both as the stages read
// them.
#pragma once
#include <vector>

#include "glint.h"
#include "math/vec.h"
#include "scene/anchor.h"
#include "shading/stages.h"

namespace glint {

struct MaterialTable;

struct InstanceTable {
  std::vector<GlintGeometry> geometries;
  std::vector<GlintAttribute> attributes;
  std::vector<GlintInstances> groups;
  std::vector<uint32_t> material_slots;
  const double* world_from_object = nullptr;
  std::vector<Placement> placements;
  std::vector<Extent> extents;  // of the geometries, object space, once `radius` asked for them
  std::vector<GroupShape> group_shapes;
  std::vector<InstanceShape> shapes;
  InstanceValues values{};
  size_t triangles = 0, primitives = 0, dropped = 0;
  uint32_t default_material = 0;
  bool only_meshes = true, has_strands = false;
  bool mirrors_differ = false;   // some are seen in mirrors and cast no shadow, or the other way
  bool diffuse_differs = false;  // some are seen in mirrors and not by diffuse rays, or not
  bool glass_differs = false;    // some are seen in mirrors and not through glass, or the other way
  bool grazing_differs = false;  // some have another geometry_offset than one over kGrazing
  bool lowers_light = false;     // some have a shading_offset

  const GlintInstances& group(uint32_t instance) const {
    return groups[placements[instance].group];
  }
  const GlintGeometry& geometry(const GlintInstances& group) const {
    return geometries[group.geometry];
  }
  const double* matrix_row(uint32_t row) const { return world_from_object + 12 * size_t(row); }
  /// The instance's matrix to anchored space.
  Affine matrix(uint32_t instance) const;
  NormalMatrix normal_matrix(uint32_t instance) const;
  /// The material of a primitive.
  uint32_t material_of(const GlintInstances& group, uint32_t primitive) const;
};

InstanceTable copy_instances(const GlintSceneData& data);

/// Whether the instance with that number stands as `there`, whose rows of matrices may be others.
bool stands(const InstanceTable& here, const InstanceTable& there, size_t i);

/// Numbers the instances, leaving out those whose matrix is not finite or squeezes everything to a
/// line. there: an earlier scene's of the same origin, or null.
void place_instances(InstanceTable& t, Vec3d origin, const InstanceTable* there);

/// The largest distance of anything from `origin`. there: of an earlier scene, or null;
/// geometry_there: numbers of the same geometries in it.
double radius(InstanceTable& t, Vec3d origin, const InstanceTable* there,
              const std::vector<uint32_t>& geometry_there);

/// In object space.
inline Vec3d vertex(const GlintGeometry& geometry, size_t row) {
  const float* p = geometry.vertices + 3 * row;
  return {p[0], p[1], p[2]};
}

/// What of a geometry has coordinates, in object space.
Extent extent_of(const GlintGeometry& geometry);

/// What the stages read. there: an earlier scene's in the same space, or null.
void shape_instances(InstanceTable& t, const Anchor& anchor, const MaterialTable& materials,
                     const InstanceTable* there);

}  // namespace glint
