#include "integrator/plan.h"

#include <algorithm>

#include "film/film.h"
#include "scene/scene.h"
#include "system/thread_pool.h"

namespace glint {
namespace {

/// The region with `by` pixels round it.
Region widened(Region r, uint32_t by, const GlintCamera& camera) {
  return {r.x0 - std::min(by, r.x0), r.y0 - std::min(by, r.y0), std::min(r.x1 + by, camera.width),
          std::min(r.y1 + by, camera.height)};
}

/// The openings of a dome in anchored space.
std::vector<Opening> openings_of(const GlintRenderSettings& g, uint32_t directions,
                                 const Anchor& anchor) {
  const double ratio = double(g.opening_samples) / directions;
  std::vector<Opening> rows(g.openings ? g.opening_count : 0);
  for (size_t i = 0; i < rows.size(); ++i) {
    const double* const row = g.openings + 13 * i;
    Opening& on = rows[i];
    const Vec3d center = anchor.point({row[0], row[1], row[2]}),
                right = anchor.scale * Vec3d{row[3], row[4], row[5]},
                up = anchor.scale * Vec3d{row[6], row[7], row[8]};
    for (int c = 0; c < 3; ++c) {
      on.center[c] = center[c];
      on.right[c] = right[c];
      on.up[c] = up[c];
      on.across[c] = right[c] / dot(right, right);
      on.along[c] = up[c] / dot(up, up);
      on.normal[c] = row[9 + c];
    }
    on.density = ratio * row[12] / (4 * length(right) * length(up));
  }
  return rows;
}

}  // namespace

RenderPlan::RenderPlan(const GlintRenderSettings& g, const Scene& scene)
    : GlintRenderSettings(g),
      thread_count(glint::thread_count(g.threads)),
      dome_directions(g.dome_table, kDomeColumns, g.dome_samples, g.dome_count),
      occlusion_directions(g.occlusion_points, 2, g.occlusion_samples, g.occlusion_count),
      subsurface_places(g.subsurface_points, 6, 1, g.subsurface_count),
      mesh_points(g.mesh_table, kPointColumns, g.mesh_samples, g.mesh_count),
      medium_points(g.medium_table, kPointColumns, g.medium_samples, g.medium_count),
      dome{g.dome_cells,   g.dome_irradiance,      g.dome_rows,
           g.dome_columns, g.dome_irradiance_rows, g.dome_irradiance_columns} {
  interleaving = std::max(g.interleaving, 1u);
  resolves = g.resolves && interleaving > 1;
  const bool catches = scene.features & (GLINT_FEATURE_SHADOW_CATCHER | GLINT_FEATURE_HOLDOUT);
  if (!resolves || moving || catches) visibility_samples = 1;
  shown = {g.region[0], g.region[1], g.region[2], g.region[3]};
  fibre_bounces = bounces;
  if (scene.instances.has_strands && scene.materials.has_fibre && bounces > 0)
    fibre_bounces = std::max(bounces, std::min(max_bounces, bounce_levels));
  reflects_gloss =
      max_bounces > 0 && ((reflections == GLINT_REFLECT_METALS && scene.materials.has_metals) ||
                          (reflections == GLINT_REFLECT_ALL && scene.materials.has_gloss));
  const bool refines = error_threshold > 0 || passes >> GLINT_PASS_ERROR & 1;
  const uint32_t resolved = resolves ? Resolve::looks_at(interleaving) : 0;
  traced = region = widened(shown, resolved, scene.camera);
  if (refines && samples >= Refinement::kFirst)
    region = widened(traced, 1 + resolved, scene.camera);
  medium_shadows = std::clamp(g.medium_shadows, 1u, medium_points.each);
  lobe_levels = std::max(g.lobe_levels, 1u);
  lobe_tabled = std::max(size_t(g.lobe_count) / lobe_levels, size_t(1));
  dome.every = std::max(dome_directions.each / std::max(light_samples, 1u), 1u);
  for (int k = 0; k < 9; ++k) dome.axes[k / 3][k % 3] = g.dome_axes[k];
  std::vector<Opening> rows = openings_of(g, dome_directions.each, scene.anchor);
  if (rows.empty()) return;
  opening_places = {g.opening_points, 3, g.opening_samples, g.opening_point_count};
  opening_rows = std::make_shared<const std::vector<Opening>>(std::move(rows));
  open = {opening_rows->data(), opening_rows->size()};
}

}  // namespace glint
