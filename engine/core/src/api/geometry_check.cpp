// The check of geometries and placements at the API boundary: of scenes, and of accelerators alone.
#include <algorithm>

#include "api/checks.h"
#include "api/queries.h"

namespace glint {
namespace {

/// A geometry without what only pictures need.
GlintGeometry shape_of(GlintGeometry g) {
  g.corners = nullptr;
  g.material_slots = nullptr;
  g.normals = {};
  g.first_attribute = g.attribute_count = 0;
  return g;
}

void check_attribute(const GlintGeometry& g, const GlintAttribute& a, uint64_t corner_end,
                     ull number, const char* what, Report& report) {
  report.add(a.values != nullptr || a.rows == 0, "geometry %llu: %s without values", number, what);
  report.add(within(a.domain, GLINT_FACE) && a.channels >= 1 && a.channels <= 4,
             "geometry %llu: %s with domain %d and %d channels", number, what, a.domain,
             a.channels);
  report.add(a.domain != GLINT_CORNER || g.corners || g.primitive_count == 0,
             "geometry %llu: %s on corners but no corners", number, what);
  uint64_t need = a.domain == GLINT_POINT    ? g.vertex_count
                  : a.domain == GLINT_CORNER ? corner_end
                                             : g.primitive_count;
  report.add(a.rows >= need, "geometry %llu: %s has %llu rows but %llu are read", number, what,
             ull(a.rows), ull(need));
}

void check_mesh(const GlintSceneData& d, const GlintGeometry& g, ull number, Report& report) {
  report.add(g.triangles || g.primitive_count == 0, "geometry %llu: no triangles", number);
  if (!report.good()) return;
  uint64_t end = end_of(g.triangles, 3 * g.primitive_count),
           corner_end = g.corners ? end_of(g.corners, 3 * g.primitive_count) : 0;
  report.add(end <= g.vertex_count, "geometry %llu: a triangle names vertex %llu of %llu", number,
             ull(end - 1), ull(g.vertex_count));
  if (g.normals.values) {
    check_attribute(g, g.normals, corner_end, number, "normals", report);
    report.add(g.normals.channels == 3 && g.normals.domain != GLINT_FACE,
               "geometry %llu: normals are not (k, 3) on POINT, CORNER", number);
  }
  for (uint32_t i = 0; i < g.attribute_count; ++i)
    check_attribute(g, d.attributes[g.first_attribute + i], corner_end, number, "an attribute",
                    report);
}

void check_polygons(const GlintGeometry& g, ull number, Report& report) {
  report.add(g.offsets && (g.indices || g.index_count == 0), "geometry %llu: no offsets or indices",
             number);
  if (!report.good()) return;
  bool rising = g.offsets[0] == 0;
  for (uint64_t i = 0; i < g.primitive_count; ++i)
    rising = rising && g.offsets[i] <= g.offsets[i + 1];
  rising = rising && g.offsets[g.primitive_count] == g.index_count;
  report.add(rising, "geometry %llu: offsets do not rise from 0 to the number of indices, %llu",
             number, ull(g.index_count));
  uint64_t end = end_of(g.indices, g.index_count);
  report.add(end <= g.vertex_count, "geometry %llu: a polygon names vertex %llu of %llu", number,
             ull(end - 1), ull(g.vertex_count));
}

void check_strands(const GlintSceneData& d, const GlintGeometry& g, ull number, Report& report) {
  const bool whole = g.indices && g.radii && g.index_count == g.primitive_count;
  report.add(whole || g.primitive_count == 0,
             "geometry %llu: strands need a radius for each vertex and a vertex for each segment",
             number);
  report.add(g.triangles || g.attribute_count == 0,
             "geometry %llu: strands with attributes need their ends in triangles", number);
  if (!report.good() || g.primitive_count == 0) return;
  const uint64_t end = end_of(g.indices, g.index_count);
  report.add(end < g.vertex_count, "geometry %llu: a segment begins at vertex %llu of %llu", number,
             ull(end - 1), ull(g.vertex_count));
  for (uint64_t k = 0; report.good() && g.triangles && k < g.primitive_count; ++k) {
    const uint32_t *ends = g.triangles + 3 * k, first = g.indices[k];
    report.add(ends[0] == first && ends[1] == first + 1 && ends[2] == first + 1,
               "geometry %llu: the ends of segment %llu are not in triangles", number, ull(k));
  }
  for (uint32_t i = 0; report.good() && i < g.attribute_count; ++i) {
    const GlintAttribute& a = d.attributes[g.first_attribute + i];
    check_attribute(g, a, 0, number, "an attribute", report);
    report.add(a.domain != GLINT_CORNER, "geometry %llu: strands have no corners", number);
  }
}

void check_spheres(const GlintSceneData& d, const GlintGeometry& g, ull number, Report& report) {
  report.add((g.radii && g.vertex_count == g.primitive_count) || g.primitive_count == 0,
             "geometry %llu: spheres need a centre and a radius each", number);
  for (uint32_t i = 0; report.good() && i < g.attribute_count; ++i) {
    const GlintAttribute& a = d.attributes[g.first_attribute + i];
    check_attribute(g, a, 0, number, "an attribute", report);
    report.add(a.domain == GLINT_FACE, "geometry %llu: spheres have a row of attributes each",
               number);
  }
}

}  // namespace

void check_geometry(const GlintSceneData& d, const GlintGeometry& g, ull number, Report& report) {
  report.add(within(g.kind, GLINT_STRANDS), "geometry %llu: unknown kind %d", number, g.kind);
  report.add(g.vertex_count <= kMaxCount && g.primitive_count <= kMaxCount / 3 &&
                 g.index_count <= kMaxCount,
             "geometry %llu: more than 2^32 vertices, corners or indices", number);
  report.add(g.vertices || g.vertex_count == 0, "geometry %llu: no vertices", number);
  report.add(range(g.first_attribute, g.attribute_count, d.attribute_count),
             "geometry %llu: attributes beyond the table", number);
  report.add(g.kind == GLINT_MESH || !g.normals.values, "geometry %llu: normals on what is no mesh",
             number);
  report.add(g.kind != GLINT_POLYGONS || g.attribute_count == 0,
             "geometry %llu: attributes on polygons", number);
  if (!report.good()) return;
  if (g.kind == GLINT_MESH) check_mesh(d, g, number, report);
  if (g.kind == GLINT_POLYGONS) check_polygons(g, number, report);
  if (g.kind == GLINT_STRANDS) check_strands(d, g, number, report);
  if (g.kind == GLINT_SPHERES) check_spheres(d, g, number, report);
}

void check_placements(const GlintInstances* groups, uint64_t count, uint64_t geometry_count,
                      uint64_t row_count, Report& report) {
  report.add(row_count <= kMaxPlacements && count <= kMaxCount, "more than 2^31 instances");
  uint64_t placed = 0;
  for (uint64_t i = 0; i < count && report.good(); ++i) {
    const GlintInstances& g = groups[i];
    report.add(g.geometry < geometry_count, "instances %llu: geometry %u of %llu", ull(i),
               g.geometry, ull(geometry_count));
    report.add(range(g.first_row, g.row_count, row_count),
               "instances %llu: rows beyond the matrices", ull(i));
    if (report.good()) placed += g.row_count;
    report.add(placed <= kMaxPlacements, "more than 2^31 instances");
  }
}

std::string accel_problems(const GlintAccelData& data) {
  Report report;
  report.add(data.geometries || data.geometry_count == 0, "geometries is null but has %llu rows",
             ull(data.geometry_count));
  report.add(data.instances || data.instances_count == 0, "instances is null but has %llu rows",
             ull(data.instances_count));
  report.add(data.world_from_object || data.row_count == 0,
             "world_from_object is null but has %llu rows", ull(data.row_count));
  report.add(data.geometry_count <= kMaxCount, "more than 2^32 geometries");
  if (!report.good()) return report.text();
  check_placements(data.instances, data.instances_count, data.geometry_count, data.row_count,
                   report);
  for (uint64_t i = 0; i < data.row_count && report.good(); ++i)
    report.add(all_finite(data.world_from_object + 12 * i, 12),
               "world_from_object: row %llu is not finite", ull(i));
  const GlintSceneData none{};
  for (uint64_t i = 0; i < data.geometry_count && report.good(); ++i)
    check_geometry(none, shape_of(data.geometries[i]), i, report);
  return report.text();
}

template <class Rays>
std::string rays_problems(const Rays& rays) {
  Report report;
  const bool any = rays.count > 0;
  report.add(!any || (rays.origins && rays.directions), "%llu rays but no origins or no directions",
             ull(rays.count));
  auto row = [](uint32_t stride) { return stride == 0 || stride >= 3; };
  report.add(row(rays.origin_stride) && row(rays.direction_stride),
             "strides of %u and %u for rows of 3 numbers", rays.origin_stride,
             rays.direction_stride);
  constexpr uint32_t all = GLINT_VISIBLE_CAMERA | GLINT_VISIBLE_MIRROR | GLINT_VISIBLE_SHADOW |
                           GLINT_VISIBLE_TRANSMISSION | GLINT_VISIBLE_DIFFUSE;
  report.add(rays.visibility != 0 && !(rays.visibility & ~all), "unknown visibility %u",
             rays.visibility);
  return report.text();
}

template std::string rays_problems(const GlintRaysF32&);
template std::string rays_problems(const GlintRaysF64&);

}  // namespace glint
