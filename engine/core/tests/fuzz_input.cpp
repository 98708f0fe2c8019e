#include "fuzz_input.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "film/passes.h"
#include "program/layout.h"

namespace glint::fuzz {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kStrange[] = {0,      -0.0,  1,      -1,     NAN,     kInf,    -kInf, 1e-45,
                               -1e-45, 1e-40, 1e-38,  3.4e38, -3.4e38, 1e30,    1e19,  1e-19,
                               1e-160, 1e160, 1e-308, 5e-324, 1.7e308, -1.7e308};

constexpr double kLarge = 0.03;  // the share of meshes and textures that are not small: trees with
                                 // several levels, built on several threads

float real(Dice& dice) { return float(dice.number()); }
double positive(Dice& dice) { return std::fabs(dice.number()); }

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
  switch (dice.below(12)) {
    case 0:
      g.vertices = nullptr;
      break;
    case 1:
      g.triangles = nullptr;
      g.radii = nullptr;
      g.offsets = nullptr;
      break;
    case 2:
      g.kind = int32_t(dice.bits());
      break;
    case 3:
      g.vertex_count = uint64_t(1) << (33 + dice.below(31));
      break;
    case 4:
      g.primitive_count = uint64_t(1) << (33 + dice.below(31));
      break;
    case 5:
      g.index_count = uint64_t(1) << (33 + dice.below(31));
      break;
    case 6:
      g.vertex_count /= 2;
      break;
    case 7:
      g.first_attribute = uint32_t(dice.bits());
      break;
    case 8:
      g.attribute_count = uint32_t(dice.bits());
      break;
    case 9:
      g.indices = nullptr;
      break;
    case 10:
      g.normals.domain = int32_t(dice.bits());
      break;
    default:
      g.normals.channels = int32_t(dice.bits());
      break;
  }
}

void wreck(Dice& dice, GlintInstances& i) {
  switch (dice.below(5)) {
    case 0:
      i.geometry = uint32_t(dice.bits());
      break;
    case 1:
      i.first_row = dice.bits();
      break;
    case 2:
      i.row_count = dice.bits();
      break;
    case 3:
      i.first_material = uint32_t(dice.bits());
      break;
    default:
      i.material_count = uint32_t(dice.bits());
      break;
  }
}

/// Breaks one row of a table, in wild cases.
template <class T>
void maybe_wreck(Dice& dice, std::vector<T>& rows) {
  if (dice.wildness > 0 && !rows.empty() && dice.chance(0.1))
    wreck(dice, rows[dice.below(rows.size())]);
}

GlintTexture texture(Dice& dice, Arena& arena) {
  GlintTexture t{};
  const size_t side = dice.chance(kLarge) ? 200 : 5;
  t.width = uint32_t(1 + dice.below(side));
  t.height = uint32_t(1 + dice.below(side));
  t.type = int32_t(dice.below(2));
  const size_t count = size_t(t.width) * t.height * 4;
  if (t.type == GLINT_FLOAT32) t.pixels = arena.fill<float>(count, [&] { return real(dice); });
  else {
    t.pixels = arena.fill<uint8_t>(count, [&] { return uint8_t(dice.bits()); });
    t.encoding = int32_t(dice.below(2));
  }
  t.extension = int32_t(dice.below(4));
  t.interpolation = int32_t(dice.below(2));
  if (dice.chance(0.1 * dice.wildness)) t.extension = int32_t(dice.bits());
  return t;
}

GlintInput input(Dice& dice, size_t textures) {
  GlintInput g{};
  for (double& x : g.value) x = dice.number();
  for (double& x : g.uv_transform) x = dice.number();
  g.texture = int32_t(dice.below(textures + 1)) - 1;
  g.channel = int32_t(dice.below(3));
  g.uv = int32_t(dice.below(4)) - 1;
  g.attribute = int32_t(dice.below(4)) - 1;
  g.attribute_channel = int32_t(dice.below(3));
  g.complement = int32_t(dice.below(2));
  for (double& x : g.offset) x = dice.number();
  g.bounded = int32_t(dice.below(2));
  g.low = dice.number();
  g.high = g.low + positive(dice);
  if (dice.chance(0.1 * dice.wildness)) g.texture = int32_t(dice.bits());
  return g;
}

GlintLobe lobe(Dice& dice, std::vector<GlintInput>& inputs, size_t textures) {
  GlintLobe g{};
  g.exponent = 40 * positive(dice);
  g.ior = 0.2 + positive(dice);
  g.kind = int32_t(dice.below(11));
  g.fresnel = int32_t(dice.below(4));
  if (dice.chance(0.3)) g.masking = double(dice.below(65)) / 64.0;
  g.first_input = uint32_t(inputs.size());
  g.input_count = uint32_t(dice.below(3));
  for (uint32_t k = 0; k < g.input_count; ++k) inputs.push_back(input(dice, textures));
  if (dice.chance(0.1 * dice.wildness)) g.kind = int32_t(dice.bits());
  if (dice.chance(0.1 * dice.wildness)) g.ior_slot = int32_t(dice.bits());
  if (dice.chance(0.1 * dice.wildness)) g.fibre_slot = int32_t(dice.bits());
  if (dice.chance(0.1 * dice.wildness)) g.normal_slot = int32_t(dice.bits());
  if (dice.chance(0.1 * dice.wildness)) g.stretch_slot = int32_t(dice.bits());
  if (dice.chance(0.1 * dice.wildness)) g.input_count = uint32_t(dice.bits());
  return g;
}

GlintLight light(Dice& dice) {
  GlintLight g{};
  for (double& x : g.world_from_light) x = dice.number();
  for (double& x : g.color) x = dice.number();
  g.strength = 10 * dice.number();
  g.radius = dice.chance(0.5) ? 0 : positive(dice);
  g.angle = dice.chance(0.5) ? 0 : positive(dice);
  g.spot_size = positive(dice);
  g.spot_blend = positive(dice);
  g.size_x = positive(dice);
  g.size_y = positive(dice);
  g.kind = int32_t(dice.below(5));
  g.flags = uint32_t(dice.below(32));
  g.program = dice.chance(0.3);
  g.program_slot = int32_t(dice.below(4));
  if (dice.chance(0.2)) g.excluded_sets = dice.bits();
  if (dice.chance(0.2)) g.passed_sets = dice.bits();
  if (dice.chance(0.1 * dice.wildness)) g.kind = int32_t(dice.bits());
  return g;
}

GlintEmitter emitter(Dice& dice) {
  GlintEmitter e{};
  for (int c = 0; c < 3; ++c) {
    e.front[c] = dice.number();
    e.back[c] = dice.number();
    e.normal[c] = dice.number();
  }
  e.spread = dice.number();
  e.reach = dice.number();
  return e;
}

/// At times one of them is a mesh light, and another is of bounced light.
int32_t light_group(Dice& dice, const GlintSceneData& d) {
  return int32_t(dice.below(size_t(d.light_group_count) + 1 + dice.chance(0.02 * dice.wildness)));
}

/// Of the last light, which may share them with the first.
void set_emitters(Dice& dice, std::vector<GlintLight>& lights, size_t count) {
  lights.back().emitter_count = count;
  if (lights.size() > 1 && count > 1 && dice.chance(0.5)) {
    lights.front().kind = GLINT_MESH_LIGHT;
    lights.front().program = 0;
    lights.front().emitter_count = 1 + dice.below(count - 1);
    lights.back().first_emitter = lights.front().emitter_count;
    lights.back().emitter_count = count - lights.front().emitter_count;
  }
  if (dice.chance(0.02 * dice.wildness)) lights.back().first_emitter += dice.below(3);
}

void set_lights(Dice& dice, Arena& arena, GlintSceneData& d) {
  std::vector<GlintLight> lights;
  for (size_t k = dice.below(4); k > 0; --k) lights.push_back(light(dice));
  std::vector<GlintEmitter> emitters;
  if (!lights.empty() && dice.chance(0.3)) {
    lights.back().kind = GLINT_MESH_LIGHT;
    lights.back().program = 0;
    for (size_t k = 1 + dice.below(20); k > 0; --k) emitters.push_back(emitter(dice));
    set_emitters(dice, lights, emitters.size());
  }
  if (lights.size() > 1 && lights.front().kind != GLINT_MESH_LIGHT && dice.chance(0.3)) {
    lights.front().kind = GLINT_BOUNCED_LIGHT;
    lights.front().program = 0;
  }
  for (GlintLight& l : lights) l.light_group = light_group(dice, d);
  for (GlintEmitter& e : emitters) e.light_group = light_group(dice, d);
  d.emitter_count = d.emitter_corner_count = emitters.size();
  d.emitters = arena.table(emitters);
  d.emitter_corners = arena.fill<float>(9 * emitters.size(), [&] { return float(dice.number()); });
  if (dice.chance(0.02 * dice.wildness)) d.emitters = nullptr;
  if (dice.chance(0.02 * dice.wildness)) d.emitter_corner_count += 1;
  d.lights = arena.table(lights);
  d.light_count = lights.size();
}

void make_panorama(Dice& dice, GlintCamera& c) {
  c.projection = int32_t(dice.below(7)) + (dice.chance(0.1 * dice.wildness) ? 7 : 0);
  for (double* ends : {c.longitude, c.latitude, c.heights}) {
    ends[0] = dice.number();
    ends[1] = ends[0] + positive(dice);
  }
  for (double* x : {&c.fov, &c.lens, &c.sensor[0], &c.sensor[1]}) *x = positive(dice);
  for (double& x : c.polynomial) x = dice.number();
  c.eye_offset = dice.chance(0.5) ? 0 : dice.number();
  c.convergence = dice.chance(0.5) ? kInf : positive(dice);
  if (dice.chance(0.5)) c.pole_merge[1] = c.pole_merge[0] + positive(dice);
}

GlintCamera camera(Dice& dice) {
  GlintCamera c{};
  for (double& x : c.world_from_camera) x = dice.number();
  c.window[0] = -positive(dice);
  c.window[1] = positive(dice);
  c.window[2] = -positive(dice);
  c.window[3] = positive(dice);
  c.clip_start = dice.chance(0.5) ? 0 : positive(dice);
  c.clip_end = dice.chance(0.5) ? kInf : c.clip_start + positive(dice);
  c.width = uint32_t(1 + dice.below(20));
  c.height = uint32_t(1 + dice.below(20));
  c.kind = int32_t(dice.below(3));
  if (c.kind == GLINT_PANORAMA) make_panorama(dice, c);
  if (dice.chance(c.kind == GLINT_PANORAMA ? 0.1 * dice.wildness : 0.3))
    c.clip_plane_count = int32_t(dice.below(7)) + dice.chance(0.1 * dice.wildness);
  for (int p = 0; p < std::min(c.clip_plane_count, 6); ++p)
    for (double& x : c.clip_planes[p]) x = dice.number();
  if (dice.chance(0.1 * dice.wildness)) c.width = uint32_t(dice.bits());
  return c;
}

/// One table without its array, or with nothing in it.
void wreck_tables(Dice& dice, GlintSceneData& d) {
  const uint64_t many = uint64_t(1) << dice.below(64);
  switch (dice.below(10)) {
    case 0:
      d.geometries = nullptr;
      d.geometry_count = many;
      break;
    case 1:
      d.attributes = nullptr;
      d.attribute_count = many;
      break;
    case 2:
      d.instances = nullptr;
      d.instances_count = many;
      break;
    case 3:
      d.world_from_object = nullptr;
      d.row_count = many;
      break;
    case 4:
      d.material_slots = nullptr;
      d.material_slot_count = many;
      break;
    case 5:
      d.textures = nullptr;
      d.texture_count = many;
      break;
    case 6:
      d.lobes = nullptr;
      d.lobe_count = many;
      break;
    case 7:
      d.lights = nullptr;
      d.light_count = many;
      break;
    case 8:
      d.material_count = d.material_count / 2;
      break;
    default:
      d.input_count = d.input_count / 2;
      break;
  }
}

/// Where an argument is: constants, or slots that are written by now.
int32_t argument(Dice& dice, int32_t width, int32_t written) {
  const bool is_constant = written < width || dice.chance(0.4);
  return is_constant ? ~int32_t(dice.below(9)) : int32_t(dice.below(size_t(written - width + 1)));
}

/// in_sky: none of the operations reads a surface.
std::vector<int32_t> random_words(Dice& dice, bool in_sky, int32_t& written) {
  std::vector<int32_t> words;
  for (size_t n = 1 + dice.below(6); n > 0; --n) {
    int32_t operation = int32_t(dice.below(size_t(kOperationCount)));
    while (in_sky && kLayouts[operation].reads_surface)
      operation = int32_t(dice.below(size_t(kOperationCount)));
    words.push_back(operation);
    const OperationLayout& layout = kLayouts[words.back()];
    const int32_t before = written;
    for (const char* w = layout.outputs; *w; written += *w++ - '0') words.push_back(written);
    for (const char* w = layout.arguments; *w; ++w)
      words.push_back(argument(dice, *w - '0', before));
    for (const char* kind = layout.settings; *kind; ++kind)
      words.push_back(*kind >= '0' && *kind < 'a' ? int32_t(dice.below(size_t(*kind - '0') + 1))
                                                  : 0);
  }
  return words;
}

/// One program.
void set_program(Dice& dice, Arena& arena, GlintSceneData& d) {
  std::vector<double> constants(12), tables{20};
  for (double& x : constants) x = dice.number();
  for (int i = 0; i < 20; ++i) tables.push_back(dice.number());
  int32_t slots = 0;
  const bool in_sky = dice.chance(0.4);
  std::vector<int32_t> words = random_words(dice, in_sky, slots);
  if (dice.chance(0.2 * dice.wildness)) words[dice.below(words.size())] = int32_t(dice.bits());
  const std::vector<GlintProgram> programs{
      {0, words.size(), 0, constants.size(), 0, tables.size(), uint32_t(slots), 0}};
  d.program_words = arena.table(words);
  d.program_word_count = words.size();
  d.program_constants = arena.table(constants);
  d.program_constant_count = constants.size();
  d.program_tables = arena.table(tables);
  d.program_table_count = tables.size();
  d.programs = arena.table(programs);
  d.program_count = 1;
  for (double& x : d.world_axes) x = dice.number();
  d.world_program = in_sky || dice.chance(0.1 * dice.wildness);
  d.world_slot = int32_t(dice.below(size_t(std::max(slots - 2, 1))));
  if (dice.chance(0.1 * dice.wildness)) d.world_slot = int32_t(dice.bits());
}

/// The last material reads the program, mostly where it has something.
void read_program(Dice& dice, const GlintSceneData& d, std::vector<GlintInput>& inputs,
                  GlintMaterial& material) {
  const size_t slots = d.programs[0].slots + (dice.chance(0.1 * dice.wildness) ? 5 : 0);
  material.program = 1;
  if (slots >= 3 && dice.chance(0.5)) material.normal = 1 + int32_t(dice.below(slots - 2));
  if (slots >= 3 && !inputs.empty()) inputs.back().output = 1 + int32_t(dice.below(slots - 2));
}

/// At times some of the materials have a medium, or the world.
void set_media(Dice& dice, Arena& arena, GlintSceneData& d, std::vector<GlintMaterial>& materials) {
  std::vector<GlintMedium> media;
  for (size_t k = dice.chance(0.4) ? 1 + dice.below(3) : 0; k > 0; --k) {
    GlintMedium medium{};
    for (int c = 0; c < 3; ++c) {
      medium.absorption[c] = std::fabs(dice.number());
      medium.scattering[c] = std::fabs(dice.number());
      medium.emission[c] = dice.number();
    }
    medium.anisotropy = dice.chance(0.05 * dice.wildness) ? dice.number() : dice.uniform(-1, 1);
    medium.step = dice.chance(0.05 * dice.wildness) ? dice.number() : dice.uniform(0.05, 1);
    if (d.program_count > 0 && dice.chance(0.5)) {
      medium.program = 1 + int32_t(dice.index(size_t(d.program_count)));
      const bool known = medium.program >= 1 && uint64_t(medium.program) <= d.program_count;
      const uint32_t slots = known ? d.programs[medium.program - 1].slots : 3;
      for (int32_t* slot : {&medium.absorption_slot, &medium.scattering_slot, &medium.emission_slot,
                            &medium.anisotropy_slot})
        if (slots >= 3 && dice.chance(0.5)) *slot = 1 + int32_t(dice.below(slots - 2));
    }
    media.push_back(medium);
  }
  for (GlintMaterial& material : materials)
    if (!media.empty() && dice.chance(0.5)) material.medium = 1 + int32_t(dice.index(media.size()));
  if (!media.empty() && dice.chance(0.3)) d.world_medium = 1 + int32_t(dice.index(media.size()));
  d.media = arena.table(media);
  d.medium_count = media.size();
}

/// Material number 3 gives to AOVs what one after it says, which may read its program.
void set_aovs(Dice& dice, GlintSceneData& d, std::vector<GlintInput>& inputs,
              std::vector<GlintLobe>& lobes, std::vector<GlintMaterial>& materials) {
  d.aov_count = int32_t(dice.below(4));
  if (d.aov_count == 0) return;
  const uint32_t first = uint32_t(lobes.size()), count = uint32_t(dice.below(4));
  for (uint32_t k = 0; k < count; ++k) {
    lobes.push_back(lobe(dice, inputs, d.texture_count));
    lobes.back().kind = GLINT_EMISSION;
    lobes.back().exponent =
        double(dice.below(size_t(d.aov_count) + dice.chance(0.05 * dice.wildness)));
  }
  materials.push_back({first, count, 0, 0, 0, 0, 0, 0});
  if (count > 0 && d.program_count > 0) read_program(dice, d, inputs, materials.back());
  materials[3].aov = int32_t(materials.size());
}

void set_materials(Dice& dice, Arena& arena, GlintSceneData& d) {
  std::vector<GlintInput> inputs;
  std::vector<GlintLobe> lobes;
  std::vector<GlintMaterial> materials;
  for (size_t m = 0; m < 4; ++m) {
    const uint32_t count = uint32_t(dice.below(4));
    materials.push_back({uint32_t(lobes.size()), count, int32_t(m), 0, 0, uint32_t(m) << 20, 0, 0});
    for (uint32_t k = 0; k < count; ++k) lobes.push_back(lobe(dice, inputs, d.texture_count));
  }
  set_program(dice, arena, d);
  if (materials.back().lobe_count > 0) read_program(dice, d, inputs, materials.back());
  set_media(dice, arena, d, materials);
  set_aovs(dice, d, inputs, lobes, materials);
  d.inputs = arena.table(inputs);
  d.input_count = inputs.size();
  d.lobes = arena.table(lobes);
  d.lobe_count = lobes.size();
  d.materials = arena.table(materials);
  d.material_count = materials.size();
}

}  // namespace

uint64_t Dice::bits() {
  uint64_t z = state_ += 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

double Dice::number() {
  if (!chance(wildness)) return chance(0.2) ? double(int(below(5)) - 2) : uniform(-2, 2);
  return chance(0.5) ? kStrange[below(std::size(kStrange))]
                     : std::ldexp(uniform(-1, 1), int(below(2000)) - 1000);
}

uint32_t Dice::index(size_t n) {
  return chance(0.02 * wildness) ? uint32_t(bits()) : uint32_t(below(n));
}

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
    p.instances.push_back(i);
  }
  maybe_wreck(dice, p.geometries);
  maybe_wreck(dice, p.instances);
  return p;
}

GlintSceneData scene(Dice& dice, Arena& arena) {
  GlintSceneData d{};
  d.camera = camera(dice);
  for (double& x : d.ambient) x = dice.number();
  for (double& x : d.background) x = dice.number();
  d.transparent = int32_t(dice.below(2));
  d.mist_start = dice.number();
  d.mist_depth = dice.number();
  d.occlusion_distance = std::fabs(dice.number());
  d.mist_falloff = int32_t(dice.below(dice.chance(0.05 * dice.wildness) ? 5 : 3));
  const size_t slots = dice.below(5);
  d.material_slots = arena.fill<uint32_t>(slots, [&] { return dice.index(4); });
  d.material_slot_count = slots;
  Placed p = placed(dice, arena, slots);
  d.light_group_count = int32_t(dice.below(4));
  d.world_light_group = light_group(dice, d);
  for (GlintInstances& i : p.instances) i.light_group = light_group(dice, d);
  d.geometries = arena.table(p.geometries);
  d.geometry_count = p.geometries.size();
  d.attributes = arena.table(p.attributes);
  d.attribute_count = p.attributes.size();
  d.instances = arena.table(p.instances);
  d.instances_count = p.instances.size();
  d.world_from_object = p.matrices;
  d.row_count = p.rows;
  std::vector<GlintTexture> textures;
  for (size_t k = dice.below(3); k > 0; --k) textures.push_back(texture(dice, arena));
  d.textures = arena.table(textures);
  d.texture_count = textures.size();
  set_materials(dice, arena, d);
  set_lights(dice, arena, d);
  if (dice.wildness > 0 && dice.chance(0.1)) wreck_tables(dice, d);
  return d;
}

GlintSceneData varied(Dice& dice, Arena& arena, const GlintSceneData& before) {
  if (dice.chance(0.1)) return scene(dice, arena);
  GlintSceneData d = before;
  if (dice.chance(0.5)) d.camera = camera(dice);
  if (dice.chance(0.3)) {
    d.ambient[0] = dice.number();
    d.transparent = 1 - d.transparent;
  }
  if (dice.chance(0.4)) {
    double* matrices = arena.make<double>(12 * d.row_count);
    std::copy(d.world_from_object, d.world_from_object + 12 * d.row_count, matrices);
    for (size_t k = 0; k < 12 * d.row_count; ++k)
      if (dice.chance(0.1)) matrices[k] = dice.number();
    d.world_from_object = matrices;
  }
  if (dice.chance(0.4)) set_lights(dice, arena, d);
  if (dice.chance(0.3)) set_materials(dice, arena, d);
  if (dice.chance(0.3) && d.instances_count > 0) d.instances_count -= dice.below(2);
  return d;
}

GlintAccelData accel(Dice& dice, Arena& arena) {
  const Placed p = placed(dice, arena, 0);
  GlintAccelData d{arena.table(p.geometries), arena.table(p.instances), p.matrices,
                   p.geometries.size(),       p.instances.size(),       p.rows};
  if (dice.wildness == 0 || !dice.chance(0.1)) return d;
  const uint64_t many = uint64_t(1) << dice.below(64);
  switch (dice.below(3)) {
    case 0:
      d.geometries = nullptr;
      d.geometry_count = many;
      break;
    case 1:
      d.instances = nullptr;
      d.instances_count = many;
      break;
    default:
      d.world_from_object = nullptr;
      d.row_count = many;
      break;
  }
  return d;
}

/// Rectangles through which a dome is sampled too, at times.
void set_openings(Dice& dice, Arena& arena, GlintRenderSettings& s) {
  if (!dice.chance(0.3)) return;
  const auto sound = [&] {
    const double x = dice.number();
    return std::isfinite(x) || dice.chance(0.02 * dice.wildness) ? x : 1;
  };
  s.opening_count = 1 + dice.below(3);
  s.opening_samples = uint32_t(1 + dice.below(5));
  s.opening_point_count = uint64_t(s.opening_samples) * (1 + dice.below(s.samples));
  s.openings = arena.fill<double>(13 * s.opening_count, sound);
  uint64_t column = 0;
  s.opening_points = arena.fill<double>(3 * s.opening_point_count, [&] {
    return column++ % 3 ? dice.uniform(-1, 1) : double(dice.below(s.opening_count));
  });
  if (dice.chance(0.05 * dice.wildness)) s.opening_point_count = 0;
  if (dice.chance(0.05 * dice.wildness)) s.opening_points = nullptr;
}

/// What a DOME light needs: its directions and maps.
void set_dome(Dice& dice, Arena& arena, GlintRenderSettings& s) {
  s.dome_samples = uint32_t(1 + dice.below(9));
  s.dome_count = uint64_t(s.samples) * s.dome_samples;
  s.dome_rows = uint32_t(1 + dice.below(4));
  s.dome_columns = uint32_t(1 + dice.below(4));
  s.dome_irradiance_rows = uint32_t(1 + dice.below(4));
  s.dome_irradiance_columns = uint32_t(1 + dice.below(4));
  for (double& x : s.dome_axes) x = dice.number();
  s.dome_table = arena.fill<double>(9 * s.dome_count, [&] { return dice.number(); });
  s.dome_cells = arena.fill<float>(uint64_t(4) * s.dome_rows * s.dome_columns,
                                   [&] { return float(dice.number()); });
  s.dome_irradiance =
      arena.fill<float>(uint64_t(3) * s.dome_irradiance_rows * s.dome_irradiance_columns,
                        [&] { return float(dice.number()); });
  if (dice.chance(0.05 * dice.wildness)) s.dome_count = 0;
  if (dice.chance(0.05 * dice.wildness)) s.dome_cells = nullptr;
}

void set_mesh_points(Dice& dice, Arena& arena, GlintRenderSettings& s) {
  s.mesh_samples = uint32_t(1 + dice.below(5));
  s.mesh_count = uint64_t(s.mesh_samples) * (1 + dice.below(s.samples));
  s.mesh_table = arena.fill<double>(3 * 18 * s.mesh_count, [&] { return dice.number(); });
  if (dice.chance(0.05 * dice.wildness)) s.mesh_count = 0;
  if (dice.chance(0.05 * dice.wildness)) s.mesh_table = nullptr;
  s.bounced_samples = uint32_t(1 + dice.below(5));
  s.bounced_shadows = uint32_t(dice.below(6));
  s.bounced_count = uint64_t(s.bounced_samples) * (1 + dice.below(s.samples));
  s.bounced_table = arena.fill<double>(18 * s.bounced_count, [&] { return dice.number(); });
  if (dice.chance(0.05 * dice.wildness)) s.bounced_count = 0;
  if (dice.chance(0.3)) return;
  s.gather_reach = positive(dice);
  s.gather_samples = uint32_t(1 + dice.below(3));
  s.gather_count = uint64_t(s.gather_samples) * (1 + dice.below(s.samples));
  s.gather_block = uint32_t(1 + dice.below(4));
  s.gather_points = arena.fill<double>(2 * s.gather_block * s.gather_block * s.gather_count,
                                       [&] { return 0.5 * dice.number(); });
  if (dice.chance(0.05 * dice.wildness)) s.gather_reach = -dice.number();
  if (dice.chance(0.05 * dice.wildness)) s.gather_count = 0;
}

void set_lens(Dice& dice, Arena& arena, GlintRenderSettings& s) {
  s.camera_block = uint32_t(1 + dice.below(3));
  const uint64_t rows = uint64_t(s.camera_block) * s.camera_block * s.samples;
  if (dice.chance(0.2)) {
    s.lens_point_count = rows;
    s.lens_points = arena.fill<double>(2 * rows, [&] { return dice.number(); });
    s.lens_focus = positive(dice);
  }
  if (dice.chance(0.2)) {
    s.camera_frame_count = rows;
    s.camera_frames = arena.fill<double>(12 * rows, [&] { return dice.number(); });
  }
  if (dice.chance(0.05 * dice.wildness)) s.camera_block = uint32_t(dice.below(5));
}

void set_reflections(Dice& dice, Arena& arena, GlintRenderSettings& s) {
  s.reflections = int32_t(dice.below(3));
  s.lobe_levels = uint32_t(1 + dice.below(3));
  s.lobe_count = s.lobe_levels * (1 + dice.below(s.samples + 1));
  s.lobe_points = arena.fill<double>(2 * s.lobe_count, [&] { return 0.5 * dice.number(); });
  if (dice.chance(0.05 * dice.wildness)) s.lobe_count = 0;
  if (dice.chance(0.05 * dice.wildness)) s.lobe_points = nullptr;
}

GlintNeighbour neighbour(Dice& dice, Arena& arena, const GlintSceneData& scene) {
  GlintNeighbour n{};
  n.camera = camera(dice);
  if (!dice.chance(0.1 * dice.wildness)) n.camera.kind = scene.camera.kind;
  n.row_count = scene.row_count - (dice.chance(0.05 * dice.wildness) ? 1 : 0);
  n.world_from_object = arena.fill<double>(12 * scene.row_count, [&] { return dice.number(); });
  std::vector<GlintShape> shapes;
  for (size_t k = 0; k < scene.geometry_count; ++k) {
    const GlintGeometry& g = scene.geometries[k];
    GlintShape shape{};
    const bool wrecked = g.vertex_count > 10000;
    if (!wrecked && dice.chance(g.kind == GLINT_MESH ? 0.5 : 0.05 * dice.wildness)) {
      shape.vertex_count = g.vertex_count + dice.chance(0.05 * dice.wildness);
      shape.vertices = arena.fill<float>(3 * shape.vertex_count, [&] { return real(dice); });
    }
    shapes.push_back(shape);
  }
  n.shapes = arena.table(shapes);
  n.shape_count = shapes.size() + dice.chance(0.05 * dice.wildness);
  return n;
}

/// Of a scene whose tables are not wrecked.
void set_neighbours(Dice& dice, Arena& arena, GlintRenderSettings& s, const GlintSceneData& scene) {
  const bool sound = scene.geometries && scene.geometry_count < 100 && scene.row_count < 1000;
  if (sound && dice.chance(0.3))
    s.neighbours = arena.fill<GlintNeighbour>(2, [&] { return neighbour(dice, arena, scene); });
}

GlintRenderSettings settings(Dice& dice, Arena& arena, const GlintSceneData& scene) {
  GlintRenderSettings s{};
  const bool stops_early = dice.chance(0.15);
  s.samples = uint32_t(stops_early ? 4 + dice.below(29) : 1 + dice.below(3));
  s.light_samples = uint32_t(1 + dice.below(3));
  s.max_bounces = uint32_t(dice.below(stops_early ? 2 : 5));
  s.threads = uint32_t(1 + dice.below(3));
  s.passes = dice.below(pass_bit(GLINT_PASS_COUNT)) | 1u;
  s.pixel_offsets = arena.fill<double>(2 * s.samples, [&] { return 0.5 * dice.number(); });
  s.light_point_count = uint64_t(s.samples) * s.light_samples;
  s.error_threshold = stops_early        ? dice.uniform(0, 16)
                      : dice.chance(0.5) ? 0
                                         : std::fabs(dice.number());
  s.cutoff = dice.chance(0.7) ? 0 : std::fabs(dice.number());
  s.light_square = arena.fill<double>(2 * s.light_point_count, [&] { return 0.5 * dice.number(); });
  s.light_disc = arena.fill<double>(2 * s.light_point_count, [&] { return 0.5 * dice.number(); });
  set_dome(dice, arena, s);
  set_openings(dice, arena, s);
  set_mesh_points(dice, arena, s);
  set_reflections(dice, arena, s);
  set_lens(dice, arena, s);
  set_neighbours(dice, arena, s, scene);
  s.occlusion_samples = uint32_t(1 + dice.below(4));
  s.occlusion_count = s.occlusion_samples * (1 + dice.below(s.samples + 1));
  s.occlusion_points =
      arena.fill<double>(2 * s.occlusion_count, [&] { return dice.uniform(-0.7, 0.7); });
  if (dice.chance(0.05 * dice.wildness)) s.occlusion_points = nullptr;
  s.node_point_count = 1 + dice.below(16);
  s.node_points =
      arena.fill<double>(5 * s.node_point_count, [&] { return dice.uniform(-0.7, 2.5); });
  if (dice.chance(0.05 * dice.wildness)) s.node_points = nullptr;
  if (dice.chance(0.05 * dice.wildness)) s.occlusion_count = 0;
  s.crypto_ids = uint32_t(1 + dice.below(8));
  if (scene.aov_count == 0) s.passes &= ~(pass_bit(GLINT_PASS_AOV));
  if (scene.light_group_count == 0) s.passes &= ~pass_bit(GLINT_PASS_LIGHT_GROUPS);
  if (dice.chance(0.05 * dice.wildness)) s.crypto_ids = uint32_t(dice.bits());
  const uint32_t w = scene.camera.width, h = scene.camera.height;
  const bool part = dice.chance(0.3);
  s.region[0] = part ? uint32_t(dice.below(w)) : 0;
  s.region[1] = part ? uint32_t(dice.below(h)) : 0;
  s.region[2] = w;
  s.region[3] = h;
  s.illumination = int32_t(dice.below(2));
  s.waves = int32_t(dice.below(3));
  s.acceleration = int32_t(dice.below(3));
  s.remember = int32_t(dice.below(2));
  s.moving = int32_t(dice.chance(0.2));
  if (dice.wildness == 0 || !dice.chance(0.1)) return s;
  switch (dice.below(8)) {
    case 0:
      s.region[dice.below(4)] = uint32_t(dice.bits());
      break;
    case 1:
      s.pixel_offsets = nullptr;
      break;
    case 2:
      s.light_point_count = 0;
      s.light_square = nullptr;
      break;
    case 3:
      s.max_bounces = uint32_t(dice.bits());
      break;
    case 4:
      s.passes = uint32_t(dice.bits());
      break;
    case 5:
      s.illumination = int32_t(dice.bits());
      break;
    case 6:
      s.acceleration = int32_t(dice.bits());
      break;
    default:
      s.samples = 0;
      break;
  }
  return s;
}

}  // namespace glint::fuzz
