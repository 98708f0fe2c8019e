// The check of a render's settings at the API boundary.
#include <algorithm>
#include <bit>
#include <cmath>

#include "film/cryptomatte.h"
#include "math/math.h"
#include "scene/scene.h"
#include "session/job.h"

namespace glint {
namespace {

bool sound_region(const uint32_t* r, const GlintCamera& camera) {
  return r[0] < r[2] && r[1] < r[3] && r[2] <= camera.width && r[3] <= camera.height;
}

/// A power of two up to 8, or 0 for none; and fewer samples than a class can have.
bool sound_interleaving(const GlintRenderSettings& g) {
  const uint32_t side = g.interleaving;
  return side <= 8 && (side & (side - 1)) == 0 && (side <= 1 || g.samples <= 1u << 24);
}

/// Of the tables: those of all pixels that deal them among themselves.
uint64_t tabled_samples(const GlintRenderSettings& g) {
  if (g.interleaving <= 1 || !sound_interleaving(g)) return g.samples;
  return uint64_t(g.interleaving) * g.interleaving * std::bit_ceil(g.samples);
}

bool enough_directions(const GlintRenderSettings& g, const Scene& scene) {
  if (!(scene.features & GLINT_FEATURE_WORLD_LIGHT)) return true;
  return g.dome_samples >= 1 && g.dome_table && g.dome_cells && g.dome_rows >= 1 &&
         g.dome_columns >= 1 && g.dome_irradiance && g.dome_irradiance_rows >= 1 &&
         g.dome_irradiance_columns >= 1 && g.dome_count >= g.dome_samples;
}

bool has_lobe_points(const GlintRenderSettings& g) {
  return g.lobe_points && g.lobe_levels >= 1 && g.lobe_count >= g.lobe_levels;
}

bool sound_openings(const GlintRenderSettings& g) {
  if (!g.openings) return true;
  if (g.opening_count < 1 || g.opening_count > 256 || g.opening_samples < 1 ||
      g.opening_samples > 1u << 16 || !g.opening_points ||
      g.opening_point_count < g.opening_samples)
    return false;
  for (uint64_t i = 0; i < 13 * g.opening_count; ++i)
    if (!std::isfinite(g.openings[i])) return false;
  for (uint64_t i = 0; i < 3 * g.opening_point_count; ++i) {
    const double at = g.opening_points[i], most = i % 3 ? 1 : double(g.opening_count - 1);
    if (!(at >= (i % 3 ? -1 : 0) && at <= most)) return false;
  }
  return true;
}

bool enough_mesh_points(const GlintRenderSettings& g, const Scene& scene) {
  return !(scene.features & GLINT_FEATURE_MESH_LIGHT) ||
         (g.mesh_samples >= 1 && g.mesh_table && g.mesh_count >= g.mesh_samples);
}

bool enough_medium_points(const GlintRenderSettings& g, const Scene& scene) {
  return !(scene.features & GLINT_FEATURE_MEDIUM_LIGHT) ||
         (g.medium_samples >= 1 && g.medium_table && g.medium_count >= g.medium_samples);
}

/// Points of the unit disc, and shares.
bool sound_bounces(const GlintRenderSettings& g) {
  if (g.bounces == 0) return true;
  if (!g.bounce_points || g.bounce_levels < 1 || g.bounce_levels > 64 || g.bounce_count < 1 ||
      g.bounce_count > 1u << 30)
    return false;
  const uint64_t rows = g.bounce_levels * g.bounce_count;
  for (const double* row = g.bounce_points; row < g.bounce_points + 3 * rows; row += 3)
    if (!(row[0] * row[0] + row[1] * row[1] < 1.001 && row[2] >= 0 && row[2] < 1)) return false;
  return true;
}

bool enough_offsets(const GlintRenderSettings& g, const Scene& scene) {
  return !scene.media.scatters || (g.volume_samples >= 1 && g.volume_samples <= 1u << 12 &&
                                   g.scatter_offsets && g.scatter_count >= tabled_samples(g));
}

bool enough_camera_rows(const GlintRenderSettings& g) {
  const uint64_t block = g.camera_block;
  const auto enough = [&](const double* table, uint64_t count) {
    return !table || (block >= 1 && block <= 1u << 12 && count / (block * block) >= g.samples);
  };
  return enough(g.lens_points, g.lens_point_count) && (!g.lens_points || g.lens_focus > 0) &&
         enough(g.camera_frames, g.camera_frame_count);
}

bool enough_occlusion(const GlintRenderSettings& g) {
  return !(g.passes >> GLINT_PASS_AMBIENT_OCCLUSION & 1) ||
         (g.occlusion_samples >= 1 && g.occlusion_points &&
          g.occlusion_count >= g.occlusion_samples);
}

/// Shares between 0 and 1 in their order, and an axis across the normal.
bool sound_subsurface(const GlintRenderSettings& g) {
  if (!g.subsurface_points) return true;
  if (g.subsurface_count < 1) return false;
  const double* const end = g.subsurface_points + 6 * g.subsurface_count;
  for (const double* row = g.subsurface_points; row < end; row += 6)
    if (!(row[0] >= 0 && row[0] < row[1] && row[1] < row[2] && row[2] <= 1 &&
          std::abs(row[3]) <= 1 && std::abs(row[4]) <= 1 && (row[5] == 1 || row[5] == 2)))
      return false;
  return true;
}

bool sound_neighbours(const GlintRenderSettings& g, const Scene& scene) {
  if (!g.neighbours || !(g.passes >> GLINT_PASS_VECTOR & 1)) return true;
  size_t rows = 0;
  for (const GlintInstances& group : scene.instances.groups)
    rows = std::max(rows, size_t(group.first_row + group.row_count));
  for (int k = 0; k < 2; ++k) {
    const GlintNeighbour& n = g.neighbours[k];
    if (n.camera.kind != scene.camera.kind || n.row_count < rows ||
        n.shape_count != scene.instances.geometries.size() || (rows && !n.world_from_object) ||
        (n.shape_count && !n.shapes))
      return false;
    for (size_t i = 0; i < n.shape_count; ++i)
      if (n.shapes[i].vertices &&
          (scene.instances.geometries[i].kind == GLINT_POLYGONS ||
           n.shapes[i].vertex_count != scene.instances.geometries[i].vertex_count))
        return false;
  }
  return true;
}

bool enough_points(const GlintRenderSettings& g, const Scene& scene) {
  if (g.light_samples <= 1 || !(scene.features & GLINT_FEATURE_SOFT_LIGHTS)) return true;
  return g.light_square && g.light_disc &&
         g.light_point_count / g.light_samples >= tabled_samples(g);
}

}  // namespace

std::string settings_problems(const GlintRenderSettings& g, const Scene& scene) {
  std::string text;
  auto add = [&](bool good, const char* sentence) {
    if (good) return;
    if (!text.empty()) text += '\n';
    text += sentence;
  };
  add(g.samples >= 1 && g.pixel_offsets, "settings: no samples or no pixel offsets");
  add(g.visibility_samples >= 1 && uint64_t(g.samples) * g.visibility_samples <= UINT32_MAX,
      "settings: no camera rays, or too many");
  add(sound_interleaving(g), "settings: blocks of pixels that deal samples are not 1 to 8 wide");
  add(g.light_samples >= 1 && enough_points(g, scene),
      "settings: fewer light points than samples * light_samples");
  add(enough_camera_rows(g), "settings: fewer lens points or frames than a block has, or no focus");
  add(enough_mesh_points(g, scene),
      "settings: fewer points of a mesh light than those of a sample");
  add(enough_medium_points(g, scene),
      "settings: fewer points of a medium light than those of a sample");
  add(sound_bounces(g), "settings: no points for bounces of light, or points that are none");
  add(enough_offsets(g, scene), "settings: fewer offsets than samples, or no volume samples");
  add(enough_directions(g, scene), "settings: fewer dome directions than those of a sample");
  add(sound_openings(g),
      "settings: openings that are none, or fewer points on them than a sample has");
  add(enough_occlusion(g), "settings: fewer directions of occlusion than those of a sample");
  add(!scene.programs.asks_rays || (g.node_points && g.node_point_count >= 1),
      "settings: no points for nodes that ask for rays");
  add(sound_neighbours(g, scene),
      "settings: neighbours with other rows, shapes or another kind of camera than the scene");
  add(g.lamp_shadows <= 1024, "settings: more than 1024 lamp shadows");
  add(g.max_bounces <= 64, "settings: more than 64 bounces");
  add(g.error_threshold >= 0 && g.error_threshold < 256,
      "settings: the error threshold is not between 0 and 256");
  add(g.cutoff >= 0 && g.cutoff <= 1, "settings: the cutoff is not between 0 and 1");
  add(g.photons <= 1u << 22, "settings: more than 2^22 photons");
  add(g.clamp_indirect >= 0, "settings: what light is held to is negative");
  add(g.passes < pass_bit(GLINT_PASS_COUNT), "settings: unknown passes");
  add(!(g.passes & Cryptomatte::kPasses) || (g.crypto_ids >= 1 && g.crypto_ids <= 64),
      "settings: not 1 to 64 ids of Cryptomatte");
  add(!(g.passes >> GLINT_PASS_AOV & 1) || scene.aov_count > 0, "settings: there are no AOVs");
  add(!(g.passes >> GLINT_PASS_LIGHT_GROUPS & 1) || scene.light_group_count > 0,
      "settings: there are no light groups");
  add(sound_region(g.region, scene.camera),
      "settings: the region is empty or reaches beyond the frame");
  add(g.illumination == GLINT_PHYSICAL || g.illumination == GLINT_CLASSIC,
      "settings: unknown illumination");
  add(g.reflections >= GLINT_REFLECT_OFF && g.reflections <= GLINT_REFLECT_ALL &&
          (g.reflections == GLINT_REFLECT_OFF || has_lobe_points(g)),
      "settings: unknown reflections, or no points for them");
  add(sound_subsurface(g),
      "settings: no points for subsurface scattering, or points that are none");
  add(!scene.materials.has_rough_glass || has_lobe_points(g),
      "settings: no points for rough glass");
  add(g.interleaving <= 1 || !(scene.features & GLINT_FEATURE_WORLD_LIGHT) || has_lobe_points(g),
      "settings: no points of lobes for a dome");
  add(g.waves >= GLINT_WAVES_UNSEEN && g.waves <= GLINT_WAVES_HELD, "settings: unknown waves");
  add(g.acceleration >= GLINT_BUILD_FAST && g.acceleration <= GLINT_BUILD_FINE,
      "settings: unknown acceleration");
  return text;
}

}  // namespace glint
