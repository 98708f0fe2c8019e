// The check at the door: every size, index and number that the core relies on later. Comparisons
// are written to fail for NaN.
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <vector>

#include "api/queries.h"
#include "program/layout.h"
#include "scene/scene.h"

namespace glint {
namespace {

constexpr uint64_t kMaxCount = 0xfffffffe;       // 32-bit numbers with one value to spare
constexpr uint64_t kMaxPlacements = 0x7fffffff;  // numbered by an int32 that is -1 for none

/// Collects sentences; after 20 only their number matters.
class Report {
 public:
  void add(bool good, const char* format, ...) __attribute__((format(printf, 3, 4))) {
    if (good || ++count_ > 20) return;
    char line[256];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (!text_.empty()) text_ += '\n';
    text_ += line;
  }
  std::string text() const {
    return count_ > 20 ? text_ + "\nand " + std::to_string(count_ - 20) + " more" : text_;
  }
  bool good() const { return count_ == 0; }

 private:
  std::string text_;
  int count_ = 0;
};

using ull = unsigned long long;

/// Whether these are the bits of a finite float.
bool is_id(uint32_t bits) { return (bits >> 23 & 0xff) != 0xff; }
bool within(int32_t x, int32_t last) { return x >= 0 && x <= last; }
bool range(uint64_t first, uint64_t count, uint64_t size) {
  return first <= size && count <= size - first;
}
bool all_finite(const double* x, int count) {
  for (int i = 0; i < count; ++i)
    if (!std::isfinite(x[i])) return false;
  return true;
}

/// One more than the largest of the numbers.
uint64_t end_of(const uint32_t* x, uint64_t count) {
  uint32_t top = 0;
  for (uint64_t i = 0; i < count; ++i) top = std::max(top, x[i]);
  return count ? uint64_t(top) + 1 : 0;
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
  report.add(g.kind == GLINT_MESH || g.kind == GLINT_STRANDS || g.attribute_count == 0,
             "geometry %llu: attributes on what is no mesh", number);
  if (!report.good()) return;
  if (g.kind == GLINT_MESH) check_mesh(d, g, number, report);
  if (g.kind == GLINT_POLYGONS) check_polygons(g, number, report);
  if (g.kind == GLINT_STRANDS) check_strands(d, g, number, report);
  if (g.kind == GLINT_SPHERES)
    report.add((g.radii && g.vertex_count == g.primitive_count) || g.primitive_count == 0,
               "geometry %llu: spheres need a centre and a radius each", number);
}

/// Geometry and rows of every group of placements; all of them together have 32-bit numbers.
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
  }
  report.add(d.instance_value_count == 0 || (d.instance_value_names && d.instance_values) ||
                 d.row_count == 0,
             "instances: values without names or numbers");
  uint64_t end = end_of(d.material_slots, d.material_slot_count);
  report.add(end <= d.material_count, "instances name material %llu of %llu", ull(end - 1),
             ull(d.material_count));
}

void check_textures(const GlintSceneData& d, Report& report) {
  for (uint64_t i = 0; i < d.texture_count; ++i) {
    const GlintTexture& t = d.textures[i];
    report.add(
        t.pixels && t.width > 0 && t.height > 0 && t.width <= 1u << 30 && t.height <= 1u << 30,
        "texture %llu: no pixels", ull(i));
    report.add(within(t.type, GLINT_FLOAT32) && within(t.encoding, GLINT_SRGB) &&
                   within(t.extension, GLINT_MIRROR_EXTENSION) &&
                   within(t.interpolation, GLINT_CUBIC) &&
                   (t.type == GLINT_UINT8 || t.encoding == GLINT_LINEAR_ENCODING),
               "texture %llu: unknown type, encoding, extension or interpolation", ull(i));
  }
}

constexpr double kLeastTable = 16;  // numbers: a row of `piecewise`, two of any other table

/// Slots of a program that hold something.
class WrittenSlots {
 public:
  explicit WrittenSlots(uint32_t slots) : written_(slots) {}
  bool has(int64_t slot, int64_t width) const {
    const auto first = written_.begin() + slot;
    return slot + width <= int64_t(written_.size()) &&
           std::all_of(first, first + width, [](char w) { return w != 0; });
  }
  void set(int64_t slot, int64_t width) { std::fill_n(written_.begin() + slot, width, char(1)); }

 private:
  std::vector<char> written_;
};

bool is_setting(const GlintSceneData& d, const GlintProgram& g, char kind, int32_t setting) {
  if (kind == 'i') return setting >= 0 && uint64_t(setting) < d.texture_count;
  if (kind == 'a') return setting >= -1;
  if (kind == '-') return setting >= 0;
  if (kind != 't') return setting >= 0 && setting <= kind - '0';
  if (setting < 0 || uint64_t(setting) >= g.table_size) return false;
  const double size = d.program_tables[g.first_table + uint64_t(setting)];
  return size >= kLeastTable && size <= double(g.table_size - uint64_t(setting) - 1);
}

/// One instruction: every constant, image and table that it names exists, slots that it reads were
/// written before.
void check_instruction(const GlintSceneData& d, const GlintProgram& g,
                       const OperationLayout& layout, const int32_t* word, ull number,
                       WrittenSlots& written, Report& report) {
  const int32_t* const outputs = word;
  bool good = true;
  for (const char* width = layout.outputs; *width; ++width, ++word)
    good = good && *word >= -1 && (*word < 0 || int64_t(*word) + (*width - '0') <= g.slots);
  for (const char* width = layout.arguments; *width; ++width, ++word) {
    const int64_t size = *width - '0';
    good = good && (*word < 0 ? ~int64_t(*word) + size <= int64_t(g.constant_count)
                              : written.has(*word, size));
  }
  for (const char* kind = layout.settings; *kind; ++kind, ++word)
    good = good && is_setting(d, g, *kind, *word);
  word = outputs;
  for (const char* width = layout.outputs; good && *width; ++width, ++word)
    if (*word >= 0) written.set(*word, *width - '0');
  report.add(good, "program %llu: an instruction names what is not there", number);
}

void check_program(const GlintSceneData& d, const GlintProgram& g, ull number, Report& report) {
  report.add(range(g.first_word, g.word_count, d.program_word_count) &&
                 range(g.first_constant, g.constant_count, d.program_constant_count) &&
                 range(g.first_table, g.table_size, d.program_table_count) && g.slots <= 1u << 20,
             "program %llu: words, constants or tables beyond the table", number);
  const int32_t* word = d.program_words + g.first_word;
  WrittenSlots written(report.good() ? g.slots : 0);
  for (uint64_t left = report.good() ? g.word_count : 0; left > 0 && report.good();) {
    const bool known = *word >= 0 && *word < kOperationCount;
    const size_t words = known ? kLayouts[*word].words() : 0;
    report.add(known && words <= left, "program %llu: unknown operation or cut off", number);
    if (!report.good()) return;
    check_instruction(d, g, kLayouts[*word], word + 1, number, written, report);
    word += words;
    left -= words;
  }
}

/// Slots that a material's lobes and inputs read, by the number that the ABI has for them.
void check_slots(const GlintSceneData& d, const GlintMaterial& m, ull number, Report& report) {
  const uint32_t slots = m.program > 0 ? d.programs[m.program - 1].slots : 0;
  const auto within_program = [&](int32_t slot, int width) {
    return slot == 0 || (slot > 0 && int64_t(slot) - 1 + width <= int64_t(slots));
  };
  bool good = within_program(m.normal, 3) && within_program(m.base_normal, 3);
  for (uint32_t l = m.first_lobe; l < m.first_lobe + m.lobe_count; ++l) {
    const GlintLobe& lobe = d.lobes[l];
    for (int32_t slot : {lobe.exponent_slot, lobe.masking_slot, lobe.ior_slot})
      good = good && within_program(slot, 1);
    good = good && within_program(lobe.fibre_slot, 3) && within_program(lobe.normal_slot, 3) &&
           within_program(lobe.stretch_slot, 3);
    for (uint32_t i = lobe.first_input; i < lobe.first_input + lobe.input_count; ++i)
      good = good && within_program(d.inputs[i].output, 3);
  }
  report.add(good, "material %llu: a slot that its program has not", number);
}

/// Whether what a material gives to AOVs is sound.
void check_aovs(const GlintSceneData& d, const GlintMaterial& m, ull number, Report& report) {
  if (m.aov == 0) return;
  report.add(m.aov > 0 && uint64_t(m.aov) <= d.material_count,
             "material %llu: AOVs beyond the table", number);
  if (!report.good()) return;
  const GlintMaterial& given = d.materials[m.aov - 1];
  bool good = given.aov == 0 && range(given.first_lobe, given.lobe_count, d.lobe_count);
  for (uint32_t l = 0; good && l < given.lobe_count; ++l) {
    const GlintLobe& lobe = d.lobes[given.first_lobe + l];
    good = lobe.kind == GLINT_EMISSION && lobe.exponent < d.aov_count &&
           lobe.exponent == std::floor(lobe.exponent);
  }
  report.add(good, "material %llu: AOVs that are not the scene's", number);
}

void check_materials(const GlintSceneData& d, Report& report) {
  for (uint64_t i = 0; i < d.input_count; ++i) {
    const GlintInput& g = d.inputs[i];
    report.add(g.texture >= -1 && (g.texture < 0 || uint64_t(g.texture) < d.texture_count),
               "input %llu: texture %d of %llu", ull(i), g.texture, ull(d.texture_count));
    report.add(within(g.channel, GLINT_LUMINANCE) && within(g.attribute_channel, GLINT_LUMINANCE) &&
                   g.uv >= -1 && g.attribute >= -1,
               "input %llu: unknown channel or name", ull(i));
    report.add(!g.bounded || g.low <= g.high, "input %llu: low %g is not at most high %g", ull(i),
               g.low, g.high);
  }
  for (uint64_t i = 0; i < d.lobe_count; ++i) {
    const GlintLobe& g = d.lobes[i];
    report.add(within(g.kind, GLINT_FIBRE_TRANSMISSION), "lobe %llu: unknown kind %d", ull(i),
               g.kind);
    report.add(range(g.first_input, g.input_count, d.input_count),
               "lobe %llu: inputs beyond the table", ull(i));
    report.add(g.exponent >= 0 && g.exponent <= 1e30,
               "lobe %llu: exponent %g is not between 0 and 1e30", ull(i), g.exponent);
    report.add(g.masking >= 0 && g.masking <= 1, "lobe %llu: masking %g is not between 0 and 1",
               ull(i), g.masking);
    report.add(g.ior > 0 && g.ior <= 1e30, "lobe %llu: index of refraction %g is not above 0",
               ull(i), g.ior);
  }
  for (uint64_t i = 0; i < d.program_count && report.good(); ++i)
    check_program(d, d.programs[i], i, report);
  for (uint64_t i = 0; i < d.material_count && report.good(); ++i) {
    const GlintMaterial& m = d.materials[i];
    report.add(range(m.first_lobe, m.lobe_count, d.lobe_count),
               "material %llu: lobes beyond the table", ull(i));
    report.add(m.program >= 0 && uint64_t(m.program) <= d.program_count,
               "material %llu: program beyond the table", ull(i));
    check_aovs(d, m, i, report);
    report.add(m.medium >= 0 && uint64_t(m.medium) <= d.medium_count,
               "material %llu: medium beyond the table", ull(i));
    report.add(within(m.bump_shadowing, GLINT_BUMP_GGX), "material %llu: unknown bump shadowing %d",
               ull(i), m.bump_shadowing);
    report.add(is_id(m.crypto), "material %llu: its id of Cryptomatte is not finite", ull(i));
    if (report.good()) check_slots(d, m, i, report);
  }
}

/// Whether no instruction of a program that was checked needs what points inside of media have not.
bool reads_places_alone(const GlintSceneData& d, const GlintProgram& g, bool of_world) {
  const int32_t *word = d.program_words + g.first_word, *const end = word + g.word_count;
  for (; word != end; word += kLayouts[*word].words()) {
    const std::string_view name = kLayouts[*word].name;
    const bool named = std::strchr(kLayouts[*word].settings, 'a') != nullptr;
    if (name == "instance_value" ? of_world
                                 : named || name == "barycentric" || name == "edge_distance")
      return false;
  }
  return true;
}

/// The program of a medium and its slots.
void check_variation(const GlintSceneData& d, uint64_t i, Report& report) {
  const GlintMedium& g = d.media[i];
  report.add(std::isfinite(g.step) && g.step > 0, "medium %llu: its step is not above 0", ull(i));
  report.add(g.program >= 0 && uint64_t(g.program) <= d.program_count,
             "medium %llu: program beyond the table", ull(i));
  if (!report.good()) return;
  const uint32_t slots = g.program > 0 ? d.programs[g.program - 1].slots : 0;
  const auto within_program = [&](int32_t slot, int width) {
    return slot >= 0 && (slot == 0 || int64_t(slot) - 1 + width <= int64_t(slots));
  };
  report.add(within_program(g.absorption_slot, 3) && within_program(g.scattering_slot, 3) &&
                 within_program(g.emission_slot, 3) && within_program(g.anisotropy_slot, 1),
             "medium %llu: a slot that its program has not", ull(i));
  const bool of_world = d.world_medium == int64_t(i) + 1;
  report.add(g.program == 0 || reads_places_alone(d, d.programs[g.program - 1], of_world),
             "medium %llu: its program reads what points in media have not", ull(i));
}

void check_media(const GlintSceneData& d, Report& report) {
  for (uint64_t i = 0; i < d.medium_count && report.good(); ++i) {
    check_variation(d, i, report);
    const GlintMedium& g = d.media[i];
    bool good = all_finite(g.absorption, 3) && all_finite(g.scattering, 3) &&
                all_finite(g.emission, 3) && g.anisotropy >= -1 && g.anisotropy <= 1;
    for (int c = 0; c < 3; ++c) good = good && g.absorption[c] >= 0 && g.scattering[c] >= 0;
    report.add(good, "medium %llu: a number that is not finite or out of range", ull(i));
  }
  report.add(d.world_medium >= 0 && uint64_t(d.world_medium) <= d.medium_count,
             "world: medium beyond the table");
}

/// Whether no instruction of a program that was checked reads a surface.
bool reads_no_surface(const GlintSceneData& d, const GlintProgram& g) {
  const int32_t *word = d.program_words + g.first_word, *const end = word + g.word_count;
  for (; word != end; word += kLayouts[*word].words())
    if (kLayouts[*word].reads_surface) return false;
  return true;
}

void check_sky(const GlintSceneData& d, Report& report) {
  report.add(all_finite(d.world_axes, 9), "world: an axis is not finite");
  report.add(std::isfinite(d.mist_start) && std::isfinite(d.mist_depth) &&
                 d.mist_falloff >= GLINT_MIST_QUADRATIC &&
                 d.mist_falloff <= GLINT_MIST_INVERSE_QUADRATIC,
             "world: its mist is not finite, or of an unknown fall-off");
  report.add(d.occlusion_distance >= 0 && d.occlusion_distance <= 1e30,
             "world: its distance of occlusion is not between 0 and 1e30");
  report.add(within(d.aov_count, 256), "scene: %d AOVs, not 0 to 256", d.aov_count);
  report.add(d.world_program >= 0 && uint64_t(d.world_program) <= d.program_count,
             "world: program beyond the table");
  if (!report.good() || d.world_program == 0) return;
  const GlintProgram& program = d.programs[d.world_program - 1];
  report.add(d.world_slot >= 0 && int64_t(d.world_slot) + 3 <= int64_t(program.slots),
             "world: a slot that its program has not");
  report.add(reads_no_surface(d, program), "world: its program reads surfaces");
}

/// Whether no instruction of a program that was checked needs a primitive: lights have none.
bool reads_no_primitive(const GlintSceneData& d, const GlintProgram& g) {
  const int32_t *word = d.program_words + g.first_word, *const end = word + g.word_count;
  for (; word != end; word += kLayouts[*word].words())
    if (std::strchr(kLayouts[*word].settings, 'a') ||
        std::strcmp(kLayouts[*word].name, "barycentric") == 0 ||
        std::strcmp(kLayouts[*word].name, "edge_distance") == 0)
      return false;
  return true;
}

void check_light(const GlintSceneData& d, uint64_t i, Report& report) {
  const GlintLight& light = d.lights[i];
  report.add(light.program >= 0 && uint64_t(light.program) <= d.program_count,
             "light %llu: program beyond the table", ull(i));
  report.add(light.level >= -1 && light.level < 128, "light %llu: level %d in the tree of lamps",
             ull(i), light.level);
  if (!report.good() || light.program == 0) return;
  const GlintProgram& program = d.programs[light.program - 1];
  report.add(light.program_slot >= 0 && int64_t(light.program_slot) + 3 <= int64_t(program.slots),
             "light %llu: a slot that its program has not", ull(i));
  report.add(light.kind < GLINT_DOME && reads_no_primitive(d, program),
             "light %llu: its program reads a primitive", ull(i));
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
  report.add(all_finite(&c.eye_offset, 1) && c.convergence > 0 && all_finite(c.pole_merge, 2) &&
                 !(c.pole_merge[1] > 0 && c.pole_merge[0] >= c.pole_merge[1]),
             "camera: an eye %g aside that converges at %g, merged from %g to %g", c.eye_offset,
             c.convergence, c.pole_merge[0], c.pole_merge[1]);
  report.add(c.clip_plane_count == 0, "camera: a panorama has no clip planes");
}

void check_surroundings(const GlintSceneData& d, Report& report) {
  const GlintCamera& c = d.camera;
  report.add(within(c.kind, GLINT_PANORAMA), "camera: unknown kind %d", c.kind);
  if (c.kind == GLINT_PANORAMA) check_panorama(c, report);
  report.add(all_finite(c.world_from_camera, 12) && all_finite(c.window, 4),
             "camera: a number is not finite");
  report.add(any(affine(c.world_from_camera).z), "camera: its view direction is zero");
  report.add(c.clip_start >= 0 && c.clip_end >= c.clip_start, "camera: clip from %g to %g",
             c.clip_start, c.clip_end);
  report.add(within(c.clip_plane_count, 6) && all_finite(c.clip_planes[0], 24),
             "camera: %d clip planes", c.clip_plane_count);
  bool sized = c.width >= 1 && c.height >= 1 && c.width <= 1u << 20 && c.height <= 1u << 20;
  report.add(sized, "camera: resolution %u by %u", c.width, c.height);
  uint64_t bounced_lights = 0;
  for (uint64_t i = 0; i < d.light_count; ++i) {
    const GlintLight& light = d.lights[i];
    bounced_lights += light.kind == GLINT_BOUNCED_LIGHT;
    report.add(light.kind != GLINT_MESH_LIGHT ||
                   (light.emitter_count > 0 &&
                    range(light.first_emitter, light.emitter_count, d.emitter_count)),
               "light %llu: triangles beyond the table, or none", ull(i));
  }
  report.add(bounced_lights <= 1, "%llu bounced lights", ull(bounced_lights));
  for (uint64_t i = 0; i < d.light_count; ++i)
    report.add(within(d.lights[i].kind, GLINT_BOUNCED_LIGHT), "light %llu: unknown kind %d", ull(i),
               d.lights[i].kind);
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

/// A geometry without what only pictures need.
GlintGeometry shape_of(GlintGeometry g) {
  g.corners = nullptr;
  g.material_slots = nullptr;
  g.normals = {};
  g.first_attribute = g.attribute_count = 0;
  return g;
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
  constexpr uint32_t all = GLINT_VISIBLE_CAMERA | GLINT_VISIBLE_MIRROR | GLINT_VISIBLE_SHADOW;
  report.add(rays.visibility != 0 && rays.visibility <= all, "unknown visibility %u",
             rays.visibility);
  return report.text();
}

template std::string rays_problems(const GlintRaysF32&);
template std::string rays_problems(const GlintRaysF64&);

}  // namespace glint
