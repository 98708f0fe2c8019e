#include "scene/medium.h"

#include <algorithm>

#include "scene/instances.h"
#include "scene/materials.h"

namespace glint {
namespace {

constexpr double kLeastStep = 3.0 / 1024;  // of a medium that varies: so rays take 1024 at most

Medium medium_of(const GlintMedium& g, const Anchor& anchor, const ProgramTable& programs) {
  const auto per_length = [&](const double* c) { return (1 / anchor.scale) * finite_color(c); };
  Medium medium;
  medium.absorption = per_length(g.absorption);
  medium.scattering = per_length(g.scattering);
  medium.extinction = medium.absorption + medium.scattering;
  medium.emission = per_length(g.emission);
  medium.anisotropy = g.anisotropy;
  medium.program = programs.of(g.program);
  medium.absorption_slot = g.absorption_slot;
  medium.scattering_slot = g.scattering_slot;
  medium.emission_slot = g.emission_slot;
  medium.anisotropy_slot = g.anisotropy_slot;
  medium.step = g.step;
  return medium;
}

InstanceShape world_space_of(const Anchor& anchor) {
  InstanceShape shape{};
  const Vec3d start = anchor.point(Vec3d{});
  for (int k = 0; k < 3; ++k) {
    shape.m[4 * k] = anchor.scale;
    shape.m[9 + k] = start[k];
    shape.normal[4 * k] = 1;
  }
  return shape;
}

/// The number, which counts from 1, of what is in a group's geometry; 0 for nothing.
int32_t medium_in(const GlintInstances& group, const MaterialTable& materials,
                  const InstanceTable& instances) {
  int32_t medium = 0;
  for (uint32_t k = 0; medium == 0 && k < group.material_count; ++k)
    medium = materials[instances.material_slots[group.first_material + k]].medium;
  return instances.geometry(group).kind == GLINT_STRANDS ? 0 : medium;
}

}  // namespace

MediaTable place_media(const GlintSceneData& data, const Anchor& anchor,
                       const ProgramTable& programs, const MaterialTable& materials,
                       const InstanceTable& instances) {
  MediaTable t;
  for (uint64_t i = 0; i < data.medium_count; ++i) {
    const Medium medium = medium_of(data.media[i], anchor, programs);
    t.varies = t.varies || medium.program;
    t.scatters = t.scatters || medium.scatters();
    t.emits = t.emits || medium.emits();
    t.rows.push_back(medium);
  }
  t.world = data.world_medium - 1;
  t.world_space = world_space_of(anchor);
  for (uint32_t i = 0; !t.rows.empty() && i < instances.placements.size(); ++i) {
    const GlintInstances& g = instances.group(i);
    const int32_t medium = medium_in(g, materials, instances);
    if (medium == 0) continue;
    // The scene's radius is not asked for where it stays in an earlier one's space.
    const Extent box = instances.extents.empty() ? extent_of(instances.geometry(g))
                                                 : instances.extents[g.geometry];
    if (box.empty()) continue;
    Extent placed;
    const Affine m = anchor.matrix(affine(instances.matrix_row(instances.placements[i].row)));
    for (int k = 0; k < 8; ++k) placed.grow(point(m, box.corner(k)));
    const Vec3d size = placed.high - placed.low;
    const double side = (size.x + size.y + size.z) / 3,
                 step = std::max(t.rows[size_t(medium - 1)].step, kLeastStep) * side;
    t.enclosures.push_back({i, uint32_t(medium - 1), placed.low, placed.high, step});
  }
  return t;
}

}  // namespace glint
