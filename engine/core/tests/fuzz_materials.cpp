#include <algorithm>
#include <cmath>

#include "fuzz_parts.h"
#include "program/layout.h"

namespace glint::fuzz {
namespace {

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
  g.kind = int32_t(dice.below(GLINT_FIBRE_TRANSMISSION + 1));
  g.fresnel = int32_t(dice.below(16));
  if (dice.chance(0.3)) g.masking = double(dice.below(65)) / 64.0;
  g.first_input = uint32_t(inputs.size());
  g.input_count = uint32_t(dice.below(3));
  for (uint32_t k = 0; k < g.input_count; ++k) inputs.push_back(input(dice, textures));
  if (dice.chance(0.1 * dice.wildness)) g.kind = int32_t(dice.bits());
  if (dice.chance(0.1 * dice.wildness)) g.ior_slot = int32_t(dice.bits());
  if (dice.chance(0.1 * dice.wildness)) g.fibre_slot = int32_t(dice.bits());
  if (dice.chance(0.1 * dice.wildness)) g.normal_slot = int32_t(dice.bits());
  if (dice.chance(0.1 * dice.wildness)) g.stretch_slot = int32_t(dice.bits());
  if (dice.chance(0.1 * dice.wildness)) g.radius_slot = int32_t(dice.bits());
  for (double& r : g.radius) r = dice.chance(0.3) ? positive(dice) : 0;
  if (dice.chance(0.1 * dice.wildness)) g.input_count = uint32_t(dice.bits());
  return g;
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
  const auto normal = [&] { return 1 + int32_t(dice.below(slots - 2)); };
  if (slots >= 3 && dice.chance(0.5)) {
    material.normal = normal();
    material.bump_shadowing = int32_t(dice.below(dice.chance(0.05 * dice.wildness) ? 5 : 4));
    if (dice.chance(0.5)) material.base_normal = normal();
  }
  if (slots >= 3 && !inputs.empty()) inputs.back().output = 1 + int32_t(dice.below(slots - 2));
}

/// At times lobes of a material that reads the program have normals of their own, or are stretched.
void turn_lobes(Dice& dice, const GlintSceneData& d, const GlintMaterial& material,
                std::vector<GlintLobe>& lobes) {
  if (d.programs[0].slots < 3) return;
  const auto slot = [&] { return 1 + int32_t(dice.below(d.programs[0].slots - 2)); };
  for (uint32_t k = 0; k < material.lobe_count; ++k) {
    if (dice.chance(0.4)) lobes[material.first_lobe + k].normal_slot = slot();
    if (dice.chance(0.4)) lobes[material.first_lobe + k].stretch_slot = slot();
    if (dice.chance(0.4)) lobes[material.first_lobe + k].radius_slot = slot();
  }
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
  materials.push_back({first, count, 0, 0, 0, 0, 0, 0, 0, 0});
  if (count > 0 && d.program_count > 0) read_program(dice, d, inputs, materials.back());
  materials[3].aov = int32_t(materials.size());
}

}  // namespace

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

void set_materials(Dice& dice, Arena& arena, GlintSceneData& d) {
  std::vector<GlintInput> inputs;
  std::vector<GlintLobe> lobes;
  std::vector<GlintMaterial> materials;
  for (size_t m = 0; m < 4; ++m) {
    const uint32_t count = uint32_t(dice.below(4));
    materials.push_back(
        {uint32_t(lobes.size()), count, int32_t(m), 0, 0, uint32_t(m) << 20, 0, 0, 0, 0});
    for (uint32_t k = 0; k < count; ++k) lobes.push_back(lobe(dice, inputs, d.texture_count));
  }
  set_program(dice, arena, d);
  if (materials.back().lobe_count > 0) {
    read_program(dice, d, inputs, materials.back());
    turn_lobes(dice, d, materials.back(), lobes);
  }
  set_media(dice, arena, d, materials);
  set_aovs(dice, d, inputs, lobes, materials);
  d.inputs = arena.table(inputs);
  d.input_count = inputs.size();
  d.lobes = arena.table(lobes);
  d.lobe_count = lobes.size();
  d.materials = arena.table(materials);
  d.material_count = materials.size();
}

}  // namespace glint::fuzz
