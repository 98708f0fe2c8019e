// Catchers of shadows: camera rays see how much of its light other things leave to such a surface,
// or throw onto it, and not the surface (SEMANTICS.md, Shadow catchers).
#include <algorithm>

#include "integrator/tracer.h"

namespace glint {
namespace {

constexpr double kMostRatio = 1000;

double ratio_of(double with, double without) {
  return without > 0 ? std::clamp(with / without, 0.0, kMostRatio) : 1;
}

double share(double x) { return 1 - std::clamp(x, 0.0, 1.0); }

}  // namespace

/// What the batch's sums have of a point, which is nothing then.
Vec3d Tracer::take_sums(size_t k) {
  const Batch& batch = batch_;
  const SumColumns& s = batch.sums;
  const Vec3d total = row(s.total, k);
  for (double* const* columns :
       {s.total, s.ambient, s.emission, s.environment, s.diffuse, s.specular, s.shadow,
        batch.lit_diffuse, batch.lit_bounced, batch.lit_specular, batch.lit_glossy_bounced})
    for (size_t c = 0; columns[0] && c < 3; ++c) columns[c][k] = 0;
  for (size_t group = 0; group < batch.group_count(); ++group)
    for (size_t c = 0; batch.gives(group) && c < 3; ++c) batch.group(group)[c][k] = 0;
  return total;
}

/// Finds the points on catchers, and cuts out those of holdouts; what they add without lights is no
/// part of the picture.
void Tracer::set_aside_caught(const Queue& queue) {
  caught_.clear();
  for (uint32_t k = 0; k < queue.size(); ++k) {
    if (!is_caught(queue, k)) continue;
    const Vec3d all = take_sums(k);
    see_lights(k);
    if (batch_.translucent[0]) set_row(batch_.translucent, k, {});
    if (is_held_out(queue, k)) {
      batch_.lit[k] = 0;
      const Vec3d passed = shader_.passed(batch_, k),
                  held{share(passed.x), share(passed.y), share(passed.z)};
      paths_.lost_alpha()[queue.slot(k)] += mean(queue.path(k).T * held);
    } else caught_.push_back({k, all - take_sums(k), {}});
  }
}

/// What the catchers' points show, now that the lights were added to them as to all others.
void Tracer::settle_caught(const Queue& queue, uint32_t sample) {
  for (Caught& point : caught_) point.with = point.glow + take_sums(point.row);
  lit_.assign(batch_.lit.begin(), batch_.lit.end());
  std::fill(batch_.lit.begin(), batch_.lit.end(), int64_t(0));
  for (const Caught& point : caught_) {
    batch_.lit[point.row] = lit_[point.row];
    lit_[point.row] = 0;  // nothing is reflected there
  }
  direct_.illuminate_catchers(batch_, sample, counts_);
  std::copy(lit_.begin(), lit_.end(), batch_.lit.begin());  // in place: reflections read it there
  for (const Caught& point : caught_) {
    const Vec3d without = point.glow + take_sums(point.row);
    see_lights(point.row);
    show_caught(queue, point.row,
                {ratio_of(point.with.x, without.x), ratio_of(point.with.y, without.y),
                 ratio_of(point.with.z, without.z)});
  }
}

/// The surroundings behind a catcher's point, and over them a shadow as dark as the ratio of its
/// light says; or nothing, where the pass has the ratio.
void Tracer::show_caught(const Queue& queue, uint32_t k, Vec3d ratio) {
  const size_t path = queue.slot(k);
  const Vec3d passed = shader_.passed(batch_, k), T = queue.path(k).T,
              seen = T * Vec3d{share(passed.x), share(passed.y), share(passed.z)};
  double* const lost = paths_.lost_alpha();
  if (double* const sums = paths_.sums(film_, GLINT_PASS_SHADOW_CATCHER)) {
    for (size_t c = 0; c < 3; ++c)
      sums[c * paths_.stride() + path] += seen[int(c)] * (1 - ratio[int(c)]);
    lost[path] += mean(seen);
    return;
  }
  const double light = std::clamp(mean(ratio), 0.0, 1.0);
  if (scene_.world.transparent_film) {
    lost[path] += light * mean(seen);
    return;
  }
  Vec3d behind = scene_.world.background;
  if (scene_.world.sky_program) {
    const double* const slot = run_sky(queue, &k, 1);
    for (int c = 0; c < 3; ++c) {
      const double radiance = slot[size_t(c) * kBlock];
      behind[c] = std::isfinite(radiance) ? radiance : 0;
    }
  }
  batch_.add(k, batch_.sums.environment, light * (seen * behind));
  batch_.add_to_group(scene_.world.light_group, k, light * (seen * behind));
}

}  // namespace glint
