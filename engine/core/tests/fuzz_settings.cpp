#include <algorithm>
#include <cmath>

#include "film/passes.h"
#include "fuzz_parts.h"

namespace glint::fuzz {
namespace {

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
  s.dome_table = arena.fill<double>(10 * s.dome_count, [&] { return dice.number(); });
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
  s.medium_samples = uint32_t(1 + dice.below(5));
  s.medium_shadows = uint32_t(dice.below(6));
  s.medium_count = uint64_t(s.medium_samples) * (1 + dice.below(s.samples));
  s.medium_table = arena.fill<double>(3 * 18 * s.medium_count, [&] { return dice.number(); });
  if (dice.chance(0.05 * dice.wildness)) s.medium_table = nullptr;
}

void set_bounces(Dice& dice, Arena& arena, GlintRenderSettings& s) {
  if (dice.chance(0.1)) s.interleaving = 1u << dice.below(4);
  s.resolves = dice.chance(0.5);
  s.reflective_caustics = dice.chance(0.5);
  s.refractive_caustics = dice.chance(0.5);
  if (dice.chance(0.3)) s.photons = uint32_t(dice.below(300));
  if (dice.chance(0.5)) return;
  s.bounces = uint32_t(dice.below(6));
  s.volume_bounces = uint32_t(dice.below(2));
  s.bounce_levels = uint32_t(1 + dice.below(3));
  s.bounce_count = 1 + dice.below(s.samples);
  s.bounce_points = arena.fill<double>(3 * s.bounce_levels * s.bounce_count,
                                       [&] { return 0.5 * std::abs(dice.number()); });
  if (dice.chance(0.05 * dice.wildness)) s.bounce_levels = 0;
  if (dice.chance(0.05 * dice.wildness)) s.bounce_points = nullptr;
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

}  // namespace

GlintRenderSettings settings(Dice& dice, Arena& arena, const GlintSceneData& scene) {
  GlintRenderSettings s{};
  const bool stops_early = dice.chance(0.15);
  s.samples = uint32_t(stops_early ? 4 + dice.below(29) : 1 + dice.below(3));
  s.light_samples = uint32_t(1 + dice.below(3));
  s.max_bounces = uint32_t(dice.below(stops_early ? 2 : 5));
  s.threads = uint32_t(1 + dice.below(3));
  s.passes = dice.below(pass_bit(GLINT_PASS_COUNT)) | 1u;
  s.visibility_samples = dice.chance(0.7) ? 1 : uint32_t(1 + dice.below(4));
  const size_t offsets = size_t(s.samples) * s.visibility_samples * s.visibility_samples;
  s.pixel_offsets = arena.fill<double>(2 * offsets, [&] { return 0.5 * dice.number(); });
  s.light_point_count = uint64_t(s.samples) * s.light_samples;
  s.error_threshold = stops_early        ? dice.uniform(0, 16)
                      : dice.chance(0.5) ? 0
                                         : std::fabs(dice.number());
  s.cutoff = dice.chance(0.7) ? 0 : std::fabs(dice.number());
  s.clamp_indirect = dice.chance(0.7) ? 0 : std::fabs(dice.number());
  s.light_square = arena.fill<double>(2 * s.light_point_count, [&] { return 0.5 * dice.number(); });
  s.light_disc = arena.fill<double>(2 * s.light_point_count, [&] { return 0.5 * dice.number(); });
  set_dome(dice, arena, s);
  set_openings(dice, arena, s);
  set_mesh_points(dice, arena, s);
  set_reflections(dice, arena, s);
  set_lens(dice, arena, s);
  set_bounces(dice, arena, s);
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
  one_of(
      dice, [&] { s.region[dice.below(4)] = uint32_t(dice.bits()); },
      [&] { s.pixel_offsets = nullptr; },
      [&] {
        s.light_point_count = 0;
        s.light_square = nullptr;
      },
      [&] { s.max_bounces = uint32_t(dice.bits()); }, [&] { s.passes = uint32_t(dice.bits()); },
      [&] { s.illumination = int32_t(dice.bits()); },
      [&] { s.acceleration = int32_t(dice.bits()); }, [&] { s.samples = 0; });
  return s;
}

}  // namespace glint::fuzz
