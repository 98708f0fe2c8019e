#include "fuzz_input.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "fuzz_parts.h"

namespace glint::fuzz {
namespace {

constexpr double kStrange[] = {0,      -0.0,  1,      -1,     NAN,     kInf,    -kInf, 1e-45,
                               -1e-45, 1e-40, 1e-38,  3.4e38, -3.4e38, 1e30,    1e19,  1e-19,
                               1e-160, 1e160, 1e-308, 5e-324, 1.7e308, -1.7e308};

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
  g.spread = dice.chance(0.5) ? 4 : positive(dice);
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

/// 0, or the number of a group.
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

/// At times one of them is a mesh light, and others are of bounced light or media.
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
  for (GlintLight& l : lights) {
    if (l.kind <= GLINT_AREA && dice.chance(0.1)) {
      l.kind = GLINT_MEDIUM_LIGHT;
      l.program = 0;
    }
    l.light_group = light_group(dice, d);
  }
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
}

void make_eye(Dice& dice, GlintCamera& c) {
  c.eye_offset = dice.number();
  c.convergence = dice.chance(0.5) ? kInf : positive(dice);
  if (dice.chance(0.5)) c.pole_merge[1] = c.pole_merge[0] + positive(dice);
  for (double& x : c.eye_up) x = dice.number();
}

/// One table without its array, or with nothing in it.
void wreck_tables(Dice& dice, GlintSceneData& d) {
  const uint64_t many = uint64_t(1) << dice.below(64);
  one_of(
      dice,
      [&] {
        d.geometries = nullptr;
        d.geometry_count = many;
      },
      [&] {
        d.attributes = nullptr;
        d.attribute_count = many;
      },
      [&] {
        d.instances = nullptr;
        d.instances_count = many;
      },
      [&] {
        d.world_from_object = nullptr;
        d.row_count = many;
      },
      [&] {
        d.material_slots = nullptr;
        d.material_slot_count = many;
      },
      [&] {
        d.textures = nullptr;
        d.texture_count = many;
      },
      [&] {
        d.lobes = nullptr;
        d.lobe_count = many;
      },
      [&] {
        d.lights = nullptr;
        d.light_count = many;
      },
      [&] { d.material_count = d.material_count / 2; }, [&] { d.input_count = d.input_count / 2; });
}

}  // namespace

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
  if (dice.chance(c.kind == GLINT_ORTHOGRAPHIC ? 0.1 * dice.wildness : 0.3)) make_eye(dice, c);
  if (dice.chance(c.kind == GLINT_PANORAMA || c.eye_offset != 0 ? 0.1 * dice.wildness : 0.3))
    c.clip_plane_count = int32_t(dice.below(7)) + dice.chance(0.1 * dice.wildness);
  for (int p = 0; p < std::min(c.clip_plane_count, 6); ++p)
    for (double& x : c.clip_planes[p]) x = dice.number();
  if (dice.chance(0.1 * dice.wildness)) c.width = uint32_t(dice.bits());
  return c;
}

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

}  // namespace glint::fuzz
