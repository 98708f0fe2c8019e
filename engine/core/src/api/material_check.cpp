// The check of materials, node programs, media and lights at the API boundary.
#include <algorithm>
#include <cstring>
#include <string_view>
#include <vector>

#include "api/checks.h"
#include "program/layout.h"
#include "shading/closure/table.h"

namespace glint {
namespace {

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

void check_parameters(const GlintLobe& g, uint64_t number, Report& report) {
  const double numbers[] = {g.exponent, g.masking, g.ior};
  for (int place = 0; place < 3; ++place) {
    const ClosureParameter& of = kClosures[g.kind].parameters[place];
    report.add(!of.name || (numbers[place] >= of.low && numbers[place] <= of.high),
               "lobe %llu: its %s %g is not between %g and %g", ull(number), of.name,
               numbers[place], of.low, of.high);
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
           within_program(lobe.stretch_slot, 3) && within_program(lobe.radius_slot, 3);
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
    good =
        lobe.kind == GLINT_EMISSION && lobe.aov < d.aov_count && lobe.aov == std::floor(lobe.aov);
  }
  report.add(good, "material %llu: AOVs that are not the scene's", number);
}

/// Whether `is` holds for no instruction of a program that was checked.
template <class Is>
bool has_none(const GlintSceneData& d, const GlintProgram& g, Is is) {
  const int32_t *word = d.program_words + g.first_word, *const end = word + g.word_count;
  while (word != end && !is(kLayouts[*word])) word += kLayouts[*word].words();
  return word == end;
}

/// Whether it needs a primitive, which points inside of media and of lights have not.
bool reads_primitive(const OperationLayout& of) {
  const std::string_view name = of.name;
  return std::strchr(of.settings, 'a') || name == "barycentric" || name == "edge_distance" ||
         name == "pixel_step";
}

/// Whether a medium's program needs nothing but places and, unless it is the world's, what it is
/// in.
bool reads_places_alone(const GlintSceneData& d, const GlintProgram& g, bool of_world) {
  return has_none(d, g, [&](const OperationLayout& of) {
    return std::string_view(of.name) == "instance_value" ? of_world : reads_primitive(of);
  });
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

}  // namespace

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
    report.add(within(g.kind, kLobeKinds - 1), "lobe %llu: unknown kind %d", ull(i), g.kind);
    report.add(range(g.first_input, g.input_count, d.input_count),
               "lobe %llu: inputs beyond the table", ull(i));
    const int last = g.kind == GLINT_SPECULAR ? GLINT_ASHIKHMIN_SHIRLEY : GLINT_BECKMANN;
    report.add(within(g.distribution, last), "lobe %llu: unknown distribution %d", ull(i),
               g.distribution);
    if (within(g.kind, kLobeKinds - 1)) check_parameters(g, i, report);
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
  report.add(has_none(d, program, [](const OperationLayout& of) { return of.reads_surface; }),
             "world: its program reads surfaces");
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
  report.add(light.kind < GLINT_DOME && has_none(d, program, reads_primitive),
             "light %llu: its program reads a primitive", ull(i));
}

}  // namespace glint
