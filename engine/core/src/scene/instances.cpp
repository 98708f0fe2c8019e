#include "scene/instances.h"

#include <algorithm>
#include <cstring>

#include "math/math.h"
#include "scene/materials.h"

namespace glint {
namespace {

/// The largest distance from `origin` of the box's corners after m.
double reach(const Extent& box, const Affine& m, Vec3d origin) {
  double far = 0;
  for (int k = 0; k < 8; ++k)
    far = std::max(far, max_abs(direction(m, box.corner(k)) + (m.t - origin)));
  return far;
}

/// Of a matrix to anchored space.
InstanceShape shape_of(const Affine& m, uint32_t group) {
  const NormalMatrix n(m);
  const Vec3d columns[7] = {m.x, m.y, m.z, m.t, n.x, n.y, n.z};
  InstanceShape shape{};
  for (int k = 0; k < 21; ++k) (k < 12 ? shape.m[k] : shape.normal[k - 12]) = columns[k / 3][k % 3];
  shape.mirrors = dot(m.x, cross(m.y, m.z)) < 0;
  shape.group = group;
  return shape;
}

bool no_rank(const Affine& m) {
  const NormalMatrix n(m);
  return !any(n.x) && !any(n.y) && !any(n.z);
}

GroupShape shape_of(const InstanceTable& t, const GlintInstances& group) {
  const GlintGeometry& g = t.geometry(group);
  GroupShape shape{};
  if (g.kind == GLINT_MESH) {
    shape.vertices = g.vertices;
    shape.triangles = g.triangles;
    shape.normals = g.normals.values;
  }
  shape.normal_rows = g.normals.domain == GLINT_CORNER ? g.corners : g.triangles;
  shape.material =
      group.material_count > 0 ? t.material_slots[group.first_material] : t.default_material;
  if (g.material_slots && group.material_count > 1) {
    shape.slots = g.material_slots;
    shape.materials = t.material_slots.data() + group.first_material;
  }
  shape.material_count = group.material_count;
  return shape;
}

}  // namespace

Affine InstanceTable::matrix(uint32_t instance) const {
  const double* m = shapes[instance].m;
  return {{m[0], m[1], m[2]}, {m[3], m[4], m[5]}, {m[6], m[7], m[8]}, {m[9], m[10], m[11]}};
}

NormalMatrix InstanceTable::normal_matrix(uint32_t instance) const {
  const double* n = shapes[instance].normal;
  return {{n[0], n[1], n[2]}, {n[3], n[4], n[5]}, {n[6], n[7], n[8]}};
}

uint32_t InstanceTable::material_of(const GlintInstances& group, uint32_t primitive) const {
  if (group.material_count == 0) return default_material;
  const uint16_t* slots = geometry(group).material_slots;
  const uint32_t slot = slots ? slots[primitive] : 0;
  return material_slots[group.first_material + std::min(slot, group.material_count - 1)];
}

InstanceTable copy_instances(const GlintSceneData& data) {
  InstanceTable t;
  t.geometries.assign(data.geometries, data.geometries + data.geometry_count);
  t.attributes.assign(data.attributes, data.attributes + data.attribute_count);
  t.groups.assign(data.instances, data.instances + data.instances_count);
  t.material_slots.assign(data.material_slots, data.material_slots + data.material_slot_count);
  t.world_from_object = data.world_from_object;
  t.values = {nullptr, data.instance_value_names, data.instance_values,
              size_t(data.instance_value_count), size_t(data.row_count)};
  for (const GlintGeometry& geometry : t.geometries) t.primitives += geometry.primitive_count;
  return t;
}

bool stands(const InstanceTable& here, const InstanceTable& there, size_t i) {
  return i < there.placements.size() &&
         std::memcmp(here.matrix_row(here.placements[i].row),
                     there.matrix_row(there.placements[i].row), 12 * sizeof(double)) == 0;
}

void place_instances(InstanceTable& t, Vec3d origin, const InstanceTable* there) {
  t.placements.reserve(t.groups.size());
  for (uint32_t g = 0; g < t.groups.size(); ++g) {
    const GlintInstances& group = t.groups[g];
    const GlintGeometry& geometry = t.geometry(group);
    for (uint64_t row = group.first_row; row < group.first_row + group.row_count; ++row) {
      t.placements.push_back({uint32_t(row), g});
      const Affine m = affine(t.matrix_row(uint32_t(row)));
      const bool good = (there && stands(t, *there, t.placements.size() - 1)) ||
                        (finite(m) && finite(m.t - origin) && !no_rank(m));
      if (!good) {
        t.placements.pop_back();
        ++t.dropped;
        continue;
      }
      if (geometry.kind == GLINT_MESH) t.triangles += geometry.primitive_count;
    }
  }
  t.values.placements = t.placements.data();
}

/// Spheres with their radii.
Extent extent_of(const GlintGeometry& geometry) {
  Extent box;
  const bool round =
      geometry.radii && (geometry.kind == GLINT_SPHERES || geometry.kind == GLINT_STRANDS);
  for (uint64_t i = 0; i < geometry.vertex_count; ++i) {
    const Vec3d p = vertex(geometry, i);
    const double r = round ? geometry.radii[i] : 0;
    if (!finite(p) || !std::isfinite(r)) continue;
    box.grow(p - Vec3d{r, r, r});
    box.grow(p + Vec3d{r, r, r});
  }
  return box;
}

double radius(InstanceTable& t, Vec3d origin, const InstanceTable* there,
              const std::vector<uint32_t>& geometry_there) {
  for (uint32_t g = 0; g < t.geometries.size(); ++g) {
    const bool known = there && geometry_there[g] < there->extents.size();
    t.extents.push_back(known ? there->extents[geometry_there[g]] : extent_of(t.geometries[g]));
  }
  double far = 0;
  for (const Placement& p : t.placements) {
    const Extent& box = t.extents[t.groups[p.group].geometry];
    if (!box.empty()) far = std::max(far, reach(box, affine(t.matrix_row(p.row)), origin));
  }
  return far;
}

void shape_instances(InstanceTable& t, const Anchor& anchor, const MaterialTable& materials,
                     const InstanceTable* there) {
  t.default_material = uint32_t(materials.size() - 1);
  t.group_shapes.reserve(t.groups.size());
  for (const GlintInstances& group : t.groups) {
    t.group_shapes.push_back(shape_of(t, group));
    t.only_meshes = t.only_meshes && t.geometry(group).kind == GLINT_MESH;
    t.has_strands = t.has_strands || t.geometry(group).kind == GLINT_STRANDS;
    t.mirrors_differ = t.mirrors_differ || !(group.flags & GLINT_VISIBLE_MIRROR) !=
                                               !(group.flags & GLINT_VISIBLE_SHADOW);
    t.diffuse_differs = t.diffuse_differs || !(group.flags & GLINT_VISIBLE_MIRROR) !=
                                                 !(group.flags & GLINT_VISIBLE_DIFFUSE);
    t.glass_differs = t.glass_differs || !(group.flags & GLINT_VISIBLE_MIRROR) !=
                                             !(group.flags & GLINT_VISIBLE_TRANSMISSION);
    t.grazing_differs = t.grazing_differs || group.geometry_offset * kGrazing != 1;
    t.lowers_light = t.lowers_light || group.shading_offset > 0;
  }
  t.shapes.reserve(t.placements.size());
  for (size_t i = 0; i < t.placements.size(); ++i) {
    const auto [row, group] = t.placements[i];
    if (there && stands(t, *there, i)) {
      t.shapes.push_back(there->shapes[i]);
      t.shapes.back().group = group;
    } else t.shapes.push_back(shape_of(anchor.matrix(affine(t.matrix_row(row))), group));
  }
}

}  // namespace glint
