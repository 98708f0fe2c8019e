#include "integrator/plan.h"

#include <algorithm>
#include <thread>

#include "scene/scene.h"

namespace glint {
namespace {

constexpr uint32_t kMaxThreads = 1024;

int threads_for(uint32_t wanted) {
  uint32_t cores = std::max(1u, std::thread::hardware_concurrency());
  return int(std::min(wanted ? wanted : cores, kMaxThreads));
}

/// The region with the pixels next to it.
Region widened(Region r, const GlintCamera& camera) {
  return {r.x0 - (r.x0 > 0), r.y0 - (r.y0 > 0), std::min(r.x1 + 1, camera.width),
          std::min(r.y1 + 1, camera.height)};
}

/// The openings of a dome in anchored space.
void add_openings(RenderPlan& plan, const GlintRenderSettings& g, const Anchor& anchor) {
  const double ratio = double(g.opening_samples) / plan.dome_directions.each;
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
  if (rows.empty()) return;
  plan.opening_places = {g.opening_points, 3, g.opening_samples, g.opening_point_count};
  plan.opening_rows = std::make_shared<const std::vector<Opening>>(std::move(rows));
  plan.open = {plan.opening_rows->data(), plan.opening_rows->size()};
}

}  // namespace

RenderPlan plan_of(const GlintRenderSettings& g, const Scene& scene) {
  const GlintCamera& camera = scene.camera;
  RenderPlan plan;
  plan.shown = plan.region = {g.region[0], g.region[1], g.region[2], g.region[3]};
  const bool refines = g.error_threshold > 0 || g.passes >> GLINT_PASS_ERROR & 1;
  if (refines && g.samples >= Refinement::kFirst) plan.region = widened(plan.shown, camera);
  plan.error_threshold = g.error_threshold;
  plan.cutoff = g.cutoff;
  plan.samples = g.samples;
  plan.light_samples = g.light_samples;
  plan.lamp_shadows = g.lamp_shadows;
  plan.max_bounces = g.max_bounces;
  plan.passes = g.passes;
  plan.crypto_ids = g.crypto_ids;
  plan.unseen = g.waves == GLINT_WAVES_UNSEEN;
  plan.hold_waves = g.waves == GLINT_WAVES_HELD;
  plan.threads = threads_for(g.threads);
  plan.quality = BuildQuality(g.acceleration);
  plan.physical = g.illumination == GLINT_PHYSICAL;
  plan.remember = g.remember != 0;
  plan.moving = g.moving != 0;
  plan.pixel_offsets = g.pixel_offsets;
  plan.light_square = g.light_square;
  plan.light_disc = g.light_disc;
  plan.dome_directions = {g.dome_table, 9, g.dome_samples, g.dome_count};
  plan.mesh_points = {g.mesh_table, kPointColumns, g.mesh_samples, g.mesh_count};
  plan.mesh_rows = size_t(g.mesh_count);
  plan.bounced_points = {g.bounced_table, kPointColumns, g.bounced_samples, g.bounced_count};
  plan.bounced_shadows = std::clamp(g.bounced_shadows, 1u, plan.bounced_points.each);
  plan.lobe_points = g.lobe_points;
  plan.lobe_levels = std::max(g.lobe_levels, 1u);
  plan.lobe_tabled = std::max(size_t(g.lobe_count) / plan.lobe_levels, size_t(1));
  plan.reflections = g.reflections;
  plan.dome.cells = g.dome_cells;
  plan.dome.rows = g.dome_rows;
  plan.dome.columns = g.dome_columns;
  plan.dome.irradiance = g.dome_irradiance;
  plan.dome.irradiance_rows = g.dome_irradiance_rows;
  plan.dome.irradiance_columns = g.dome_irradiance_columns;
  plan.volume_samples = g.volume_samples;
  plan.scatter_offsets = g.scatter_offsets;
  plan.lens_points = g.lens_points;
  plan.camera_frames = g.camera_frames;
  plan.camera_block = g.camera_block;
  plan.neighbours = g.neighbours;
  plan.occlusion_directions = {g.occlusion_points, 2, g.occlusion_samples, g.occlusion_count};
  plan.node_points = g.node_points;
  plan.node_point_count = g.node_point_count;
  plan.lens_focus = g.lens_focus;
  plan.gather_reach = scene.anchor.scale * g.gather_reach;
  plan.gather_places = {g.gather_points, 2, g.gather_samples, g.gather_count};
  add_openings(plan, g, scene.anchor);
  for (int k = 0; k < 9; ++k) plan.dome.axes[k / 3][k % 3] = g.dome_axes[k];
  return plan;
}

}  // namespace glint
