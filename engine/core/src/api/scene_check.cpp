// The check at the API boundary: every size, index and number that the core relies on later.
#include <vector>

#include "api/checks.h"
#include "scene/scene.h"

namespace glint {
namespace {

/// 0, or 1 plus the number of a group.
bool is_light_group(const GlintSceneData& d, int32_t group) {
  return within(group, d.light_group_count);
}

void check_light_groups(const GlintSceneData& d, Report& report) {
  report.add(within(d.light_group_count, 64), "scene: %d light groups, not 0 to 64",
             d.light_group_count);
  report.add(is_light_group(d, d.world_light_group), "world: no such light group");
  for (uint64_t i = 0; report.good() && i < d.light_count; ++i)
    report.add(is_light_group(d, d.lights[i].light_group), "light %llu: no such light group",
               ull(i));
  for (uint64_t i = 0; report.good() && i < d.emitter_count; ++i)
    report.add(is_light_group(d, d.emitters[i].light_group), "emitter %llu: no such light group",
               ull(i));
}

void check_instances(const GlintSceneData& d, Report& report) {
  check_placements(d.instances, d.instances_count, d.geometry_count, d.row_count, report);
  for (uint64_t i = 0; i < d.instances_count && report.good(); ++i)
    report.add(
        range(d.instances[i].first_material, d.instances[i].material_count, d.material_slot_count),
        "instances %llu: materials beyond the table", ull(i));
  for (uint64_t i = 0; i < d.instances_count && report.good(); ++i) {
    report.add(is_id(d.instances[i].crypto_object) && is_id(d.instances[i].crypto_asset),
               "instances %llu: an id of Cryptomatte is not finite", ull(i));
    report.add(d.instances[i].light_set < 64, "instances %llu: light set %u of 64", ull(i),
               d.instances[i].light_set);
    report.add(is_light_group(d, d.instances[i].light_group), "instances %llu: no such light group",
               ull(i));
    const double low = d.instances[i].geometry_offset, lower = d.instances[i].shading_offset;
    report.add(low >= 0 && std::isfinite(low) && lower >= 0 && lower <= 1,
               "instances %llu: shadow terminator offsets %g and %g", ull(i), low, lower);
  }
  report.add(d.instance_value_count == 0 || (d.instance_value_names && d.instance_values) ||
                 d.row_count == 0,
             "instances: values without names or numbers");
  uint64_t end = end_of(d.material_slots, d.material_slot_count);
  report.add(end <= d.material_count, "instances name material %llu of %llu", ull(end - 1),
             ull(d.material_count));
}

/// Whether two numbers are finite and apart, and so is their difference.
bool is_range(const double* ends) {
  return std::isfinite(ends[0]) && std::isfinite(ends[1]) && std::isfinite(ends[1] - ends[0]) &&
         ends[0] != ends[1];
}

void check_panorama(const GlintCamera& c, Report& report) {
  report.add(within(c.projection, GLINT_CENTRAL_CYLINDRICAL), "camera: unknown projection %d",
             c.projection);
  report.add(is_range(c.longitude) && is_range(c.latitude) && is_range(c.heights),
             "camera: longitudes %g to %g, latitudes %g to %g, heights %g to %g", c.longitude[0],
             c.longitude[1], c.latitude[0], c.latitude[1], c.heights[0], c.heights[1]);
  report.add(all_finite(&c.fov, 1) && c.fov > 0 && all_finite(&c.lens, 1) && c.lens > 0,
             "camera: a fisheye of %g radians, a lens of %g", c.fov, c.lens);
  report.add(all_finite(c.sensor, 2) && c.sensor[0] > 0 && c.sensor[1] > 0,
             "camera: a sensor of %g by %g", c.sensor[0], c.sensor[1]);
  report.add(all_finite(c.polynomial, 5), "camera: the lens polynomial is not finite");
  report.add(c.clip_plane_count == 0, "camera: a panorama has no clip planes");
}

void check_eye(const GlintCamera& c, Report& report) {
  report.add(all_finite(&c.eye_offset, 1) && c.convergence > 0 && all_finite(c.pole_merge, 2) &&
                 all_finite(c.eye_up, 3) &&
                 !(c.pole_merge[1] > 0 && c.pole_merge[0] >= c.pole_merge[1]),
             "camera: an eye %g aside that converges at %g, merged from %g to %g", c.eye_offset,
             c.convergence, c.pole_merge[0], c.pole_merge[1]);
  report.add(c.kind != GLINT_ORTHOGRAPHIC, "camera: an orthographic one has no eye");
  report.add(c.clip_plane_count == 0, "camera: an eye of a pair has no clip planes");
}

void check_surroundings(const GlintSceneData& d, Report& report) {
  const GlintCamera& c = d.camera;
  report.add(within(c.kind, GLINT_PANORAMA), "camera: unknown kind %d", c.kind);
  if (c.kind == GLINT_PANORAMA) check_panorama(c, report);
  if (c.eye_offset != 0) check_eye(c, report);
  report.add(all_finite(c.world_from_camera, 12) && all_finite(c.window, 4),
             "camera: a number is not finite");
  report.add(any(affine(c.world_from_camera).z), "camera: its view direction is zero");
  report.add(c.clip_start >= 0 && c.clip_end >= c.clip_start, "camera: clip from %g to %g",
             c.clip_start, c.clip_end);
  report.add(within(c.clip_plane_count, 6) && all_finite(c.clip_planes[0], 24),
             "camera: %d clip planes", c.clip_plane_count);
  bool sized = c.width >= 1 && c.height >= 1 && c.width <= 1u << 20 && c.height <= 1u << 20;
  report.add(sized, "camera: resolution %u by %u", c.width, c.height);
  for (uint64_t i = 0; i < d.light_count; ++i) {
    const GlintLight& light = d.lights[i];
    report.add(light.kind != GLINT_MESH_LIGHT ||
                   (light.emitter_count > 0 &&
                    range(light.first_emitter, light.emitter_count, d.emitter_count)),
               "light %llu: triangles beyond the table, or none", ull(i));
    report.add(within(light.kind, GLINT_MEDIUM_LIGHT), "light %llu: unknown kind %d", ull(i),
               light.kind);
  }
}

void check_tables(const GlintSceneData& d, Report& report) {
  const struct {
    const void* table;
    uint64_t count;
  } tables[] = {
      {d.geometries, d.geometry_count},
      {d.attributes, d.attribute_count},
      {d.instances, d.instances_count},
      {d.world_from_object, d.row_count},
      {d.material_slots, d.material_slot_count},
      {d.textures, d.texture_count},
      {d.program_words, d.program_word_count},
      {d.program_constants, d.program_constant_count},
      {d.program_tables, d.program_table_count},
      {d.programs, d.program_count},
      {d.inputs, d.input_count},
      {d.lobes, d.lobe_count},
      {d.materials, d.material_count},
      {d.media, d.medium_count},
      {d.lights, d.light_count},
      {d.emitters, d.emitter_count},
      {d.emitter_corners, d.emitter_corner_count},
  };
  for (const auto& t : tables)
    report.add(t.table != nullptr || t.count == 0, "a table is null but has %llu rows",
               ull(t.count));
  report.add(d.emitter_count == d.emitter_corner_count && d.emitter_count <= kMaxCount,
             "the mesh lights have %llu triangles and the corners of %llu", ull(d.emitter_count),
             ull(d.emitter_corner_count));
  report.add(
      d.geometry_count <= kMaxCount && d.lobe_count < kMaxCount && d.material_count < kMaxCount,
      "a table is too long");
}

/// All but the geometries.
Report check_all_else(const GlintSceneData& data) {
  Report report;
  check_tables(data, report);
  if (!report.good()) return report;
  check_surroundings(data, report);
  check_light_groups(data, report);
  check_textures(data, report);
  check_materials(data, report);
  check_media(data, report);  // whose programs are sound
  if (report.good()) check_sky(data, report);
  for (uint64_t i = 0; report.good() && i < data.light_count; ++i) check_light(data, i, report);
  check_instances(data, report);
  return report;
}

}  // namespace

std::string scene_problems(const GlintSceneData& data) {
  Report report = check_all_else(data);
  for (uint64_t i = 0; i < data.geometry_count && report.good(); ++i)
    check_geometry(data, data.geometries[i], i, report);
  return report.text();
}

std::string scene_problems(const GlintSceneData& data, const Scene& base) {
  Report report = check_all_else(data);
  if (!report.good()) return report.text();
  const std::vector<uint32_t> there = same_geometries(data, base);
  for (uint64_t i = 0; i < data.geometry_count && report.good(); ++i) {
    const GlintGeometry& g = data.geometries[i];
    if (there[i] == AccelBase::kNone ||
        !same_attributes(data, g, base, base.instances.geometries[there[i]]))
      check_geometry(data, g, i, report);
  }
  return report.text();
}

}  // namespace glint
