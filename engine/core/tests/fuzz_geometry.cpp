#include <algorithm>
#include <cmath>

#include "fuzz_parts.h"

namespace glint::fuzz {
namespace {

GlintAttribute attribute(Dice& dice, Arena& arena, const GlintGeometry& g, size_t corner_rows,
                         int32_t channels) {
  GlintAttribute a{};
  a.domain = int32_t(dice.below(g.corners ? 3 : 1)) * (g.corners ? 1 : 2);
  a.rows = a.domain == GLINT_POINT    ? g.vertex_count
           : a.domain == GLINT_CORNER ? corner_rows
                                      : g.primitive_count;
  a.channels = channels;
  a.name = int32_t(dice.below(3));
  a.values = arena.fill<float>(a.rows * size_t(channels), [&] { return real(dice); });
  return a;
}

void add_attributes(Dice& dice, Arena& arena, GlintGeometry& g, Placed& placed) {
  const size_t rows = 1 + dice.below(20);
  if (dice.chance(0.5))
    g.corners = arena.fill<uint32_t>(3 * g.primitive_count, [&] { return dice.index(rows); });
  if (dice.chance(0.4)) {
    g.normals = attribute(dice, arena, g, rows, 3);
    if (g.normals.domain == GLINT_FACE) g.normals = {};
  }
  for (size_t k = dice.below(3); k > 0; --k, ++g.attribute_count)
    placed.attributes.push_back(attribute(dice, arena, g, rows, dice.chance(0.5) ? 2 : 4));
}

void make_mesh(Dice& dice, Arena& arena, GlintGeometry& g, Placed& placed) {
  g.primitive_count = dice.below(g.vertex_count > 40 ? 6000 : 60);
  g.triangles =
      arena.fill<uint32_t>(3 * g.primitive_count, [&] { return dice.index(g.vertex_count); });
  add_attributes(dice, arena, g, placed);
}

void make_polygons(Dice& dice, Arena& arena, GlintGeometry& g) {
  g.primitive_count = dice.below(8);
  uint32_t* offsets = arena.make<uint32_t>(g.primitive_count + 1);
  for (size_t k = 0; k < g.primitive_count; ++k)
    offsets[k + 1] = offsets[k] + uint32_t(dice.below(7));
  if (dice.chance(dice.wildness))
    offsets[dice.below(g.primitive_count + 1)] = uint32_t(dice.bits());
  g.offsets = offsets;
  g.index_count = dice.chance(0.95) ? offsets[g.primitive_count] : dice.below(30);
  if (g.index_count > 1000) g.index_count = 3;
  g.indices = arena.fill<uint32_t>(g.index_count, [&] { return dice.index(g.vertex_count); });
}

void make_strands(Dice& dice, Arena& arena, GlintGeometry& g, Placed& placed) {
  g.primitive_count = g.index_count = dice.below(60);
  g.radii = arena.fill<float>(g.vertex_count, [&] { return 0.2f * real(dice); });
  // most of them begin before the last vertex
  const auto first = [&] {
    return dice.chance(dice.wildness / 30) ? uint32_t(dice.bits()) : dice.index(g.vertex_count - 1);
  };
  uint32_t* starts =
      arena.fill<uint32_t>(g.index_count, [&] { return g.vertex_count > 1 ? first() : 0; });
  g.indices = starts;
  if (dice.chance(0.5)) return;
  uint32_t* ends = arena.fill<uint32_t>(3 * g.primitive_count, [] { return 0u; });
  for (size_t k = 0; k < g.primitive_count; ++k) {
    ends[3 * k] = starts[k];
    ends[3 * k + 1] = ends[3 * k + 2] = starts[k] + (dice.chance(dice.wildness / 30) ? 7 : 1);
  }
  g.triangles = ends;
  for (size_t k = dice.below(3); k > 0; --k, ++g.attribute_count)
    placed.attributes.push_back(attribute(dice, arena, g, 1, dice.chance(0.5) ? 2 : 4));
}

GlintGeometry geometry(Dice& dice, Arena& arena, Placed& placed) {
  GlintGeometry g{};
  const size_t kind = dice.below(6);
  g.kind = kind < 3    ? GLINT_MESH
           : kind == 3 ? GLINT_SPHERES
           : kind == 4 ? GLINT_STRANDS
                       : GLINT_POLYGONS;
  g.vertex_count = 1 + dice.below(dice.chance(kLarge) ? 4000 : 40);
  g.vertices = arena.fill<float>(3 * g.vertex_count, [&] { return real(dice); });
  g.first_attribute = uint32_t(placed.attributes.size());
  if (g.kind == GLINT_MESH) make_mesh(dice, arena, g, placed);
  if (g.kind == GLINT_POLYGONS) make_polygons(dice, arena, g);
  if (g.kind == GLINT_STRANDS) make_strands(dice, arena, g, placed);
  if (g.kind == GLINT_SPHERES) {
    g.primitive_count = g.vertex_count;
    g.radii = arena.fill<float>(g.primitive_count, [&] { return 0.3f * real(dice); });
  }
  if (dice.chance(0.3))
    g.material_slots =
        arena.fill<uint16_t>(g.primitive_count, [&] { return uint16_t(dice.below(4)); });
  return g;
}

void wreck(Dice& dice, GlintGeometry& g) {
  one_of(
      dice, [&] { g.vertices = nullptr; },
      [&] {
        g.triangles = nullptr;
        g.radii = nullptr;
        g.offsets = nullptr;
      },
      [&] { g.kind = int32_t(dice.bits()); },
      [&] { g.vertex_count = uint64_t(1) << (33 + dice.below(31)); },
      [&] { g.primitive_count = uint64_t(1) << (33 + dice.below(31)); },
      [&] { g.index_count = uint64_t(1) << (33 + dice.below(31)); }, [&] { g.vertex_count /= 2; },
      [&] { g.first_attribute = uint32_t(dice.bits()); },
      [&] { g.attribute_count = uint32_t(dice.bits()); }, [&] { g.indices = nullptr; },
      [&] { g.normals.domain = int32_t(dice.bits()); },
      [&] { g.normals.channels = int32_t(dice.bits()); });
}

void wreck(Dice& dice, GlintInstances& i) {
  one_of(
      dice, [&] { i.geometry = uint32_t(dice.bits()); }, [&] { i.first_row = dice.bits(); },
      [&] { i.row_count = dice.bits(); }, [&] { i.first_material = uint32_t(dice.bits()); },
      [&] { i.material_count = uint32_t(dice.bits()); });
}

/// Breaks one row of a table, in wild cases.
template <class T>
void maybe_wreck(Dice& dice, std::vector<T>& rows) {
  if (dice.wildness > 0 && !rows.empty() && dice.chance(0.1))
    wreck(dice, rows[dice.below(rows.size())]);
}

}  // namespace

Placed placed(Dice& dice, Arena& arena, size_t materials) {
  Placed p;
  for (size_t k = dice.below(4); k > 0; --k) p.geometries.push_back(geometry(dice, arena, p));
  p.rows = dice.below(12);
  p.matrices = arena.fill<double>(12 * p.rows, [&] { return dice.number(); });
  for (size_t k = p.geometries.empty() ? 0 : dice.below(5); k > 0; --k) {
    GlintInstances i{};
    i.light_set = uint32_t(dice.below(dice.chance(0.05 * dice.wildness) ? 80 : 64));
    i.crypto_object = uint32_t(dice.below(dice.chance(0.05 * dice.wildness) ? 1u << 31 : 9u));
    i.crypto_asset = uint32_t(dice.below(3)) << 24;
    i.first_row = dice.below(p.rows + 1);
    i.row_count = dice.below(p.rows - i.first_row + 1);
    i.geometry = dice.index(p.geometries.size());
    i.flags = uint32_t(dice.below(32)) | (dice.chance(0.7) ? 7 : 0);
    i.material_count = uint32_t(materials ? dice.below(materials + 1) : 0);
    i.geometry_offset = dice.chance(0.7) ? 0.1 : 0.5 * double(dice.below(3));
    i.shading_offset = dice.chance(0.7) ? 0 : 0.5 * double(dice.below(3));
    p.instances.push_back(i);
  }
  maybe_wreck(dice, p.geometries);
  maybe_wreck(dice, p.instances);
  return p;
}

GlintAccelData accel(Dice& dice, Arena& arena) {
  const Placed p = placed(dice, arena, 0);
  GlintAccelData d{arena.table(p.geometries), arena.table(p.instances), p.matrices,
                   p.geometries.size(),       p.instances.size(),       p.rows};
  if (dice.wildness == 0 || !dice.chance(0.1)) return d;
  const uint64_t many = uint64_t(1) << dice.below(64);
  one_of(
      dice,
      [&] {
        d.geometries = nullptr;
        d.geometry_count = many;
      },
      [&] {
        d.instances = nullptr;
        d.instances_count = many;
      },
      [&] {
        d.world_from_object = nullptr;
        d.row_count = many;
      });
  return d;
}

}  // namespace glint::fuzz
