#include "scene/programs.h"

#include <algorithm>
#include <string_view>

#include "program/layout.h"
#include "shading/stages.h"

namespace glint {
namespace {

/// Whether some instruction is one of these operations.
bool has_one(const int32_t* word, uint64_t count, std::initializer_list<std::string_view> names) {
  bool found = false;
  for (const int32_t* const end = word + count; word < end; word += kLayouts[*word].words())
    found = found || std::ranges::count(names, kLayouts[*word].name) > 0;
  return found;
}

}  // namespace

ProgramTable copy_programs(const GlintSceneData& data) {
  ProgramTable t;
  t.words.assign(data.program_words, data.program_words + data.program_word_count);
  t.constants = spread_constants(data.program_constants, data.program_constant_count);
  t.tables.assign(data.program_tables, data.program_tables + data.program_table_count);
  for (uint64_t i = 0; i < data.program_count; ++i) {
    const GlintProgram& g = data.programs[i];
    const int32_t* const words = t.words.data() + g.first_word;
    t.rows.push_back({words, g.word_count, t.constants.data() + g.first_constant * kPad,
                      t.tables.data() + g.first_table, g.slots,
                      has_one(words, g.word_count, {"ray_length", "ray_depth"}),
                      has_one(words, g.word_count,
                              {"ambient_occlusion", "bevel", "raycast", "raycast_attribute"})});
    t.asks_rays = t.asks_rays || t.rows.back().asks_rays;
    t.most_slots = std::max(t.most_slots, g.slots);
  }
  return t;
}

World world_of(const GlintSceneData& data, const ProgramTable& programs) {
  World world;
  world.ambient = finite_color(data.ambient);
  world.background = finite_color(data.background);
  world.transparent_film = data.transparent != 0;
  world.mist = {data.mist_start, data.mist_depth > 0 ? 1 / data.mist_depth : 0, data.mist_falloff};
  world.occlusion_distance = data.occlusion_distance;
  world.light_group = data.world_light_group - 1;
  world.sky_program = programs.of(data.world_program);
  if (world.sky_program) world.sky_slot = size_t(data.world_slot) * kBlock;
  const double* const axes = data.world_axes;
  for (int k = 0; k < 3; ++k) world.sky_axes[k] = {axes[3 * k], axes[3 * k + 1], axes[3 * k + 2]};
  return world;
}

Vec3d finite_color(const double* c) {
  const auto channel = [](double x) { return std::isfinite(x) ? std::clamp(x, -1e100, 1e100) : 0; };
  return {channel(c[0]), channel(c[1]), channel(c[2])};
}

}  // namespace glint
