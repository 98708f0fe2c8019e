// Catchers of shadows: camera rays see how much of its light other things leave to such a surface,
// or throw onto it, and not the surface (semantics/environment.md).
#include <algorithm>

#include "integrator/tracer.h"

namespace glint {
namespace {

double share(double x) { return 1 - std::clamp(x, 0.0, 1.0); }

}  // namespace

/// What the batch's sums have of a point, which is nothing then.
Vec3d Tracer::take_sums(size_t k) {
  const Batch& batch = batch_;
  const SumColumns& s = batch.sums;
  const Vec3d total = row(s.total, k);
  for (double* const* columns : {s.total, s.ambient, s.emission, s.environment, s.diffuse,
                                 s.specular, s.shadow, batch.lit_diffuse, batch.lit_specular})
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
    } else caught_.push_back({k, all - take_sums(k)});
  }
}

/// What the catchers' points have of light, now that the lights were added to them as to all
/// others, and the rays by which more of it bounces to them.
void Tracer::settle_caught(const Queue& queue) {
  if (caught_.empty()) return;
  std::vector<Vec3d> with;
  for (const Caught& point : caught_) with.push_back(point.glow + take_sums(point.row));
  lit_.assign(batch_.lit, batch_.lit + queue.size());
  std::fill_n(batch_.lit, queue.size(), int64_t(0));
  for (const Caught& point : caught_) {
    batch_.lit[point.row] = lit_[point.row];
    lit_[point.row] = 0;  // nothing is reflected there
  }
  direct_.illuminate_catchers(batch_, sample_);
  for (const auto caught : {Queue::Past::kWithAll, Queue::Past::kAlone}) {
    Queue::Past past = queue.past.scattered();
    past.caught = caught;
    Queue gathering = take(kDiffuse, past);
    bounce(queue, gathering);
    wait(std::move(gathering));
  }
  std::copy(lit_.begin(), lit_.end(), batch_.lit);  // in place: reflections read it there
  for (size_t i = 0; i < caught_.size(); ++i) {
    const uint32_t k = caught_[i].row;
    CaughtPath& path = caught_paths_[queue.slot(k)];
    const Vec3d passed = shader_.passed(batch_, k);
    path.seen += queue.path(k).T * Vec3d{share(passed.x), share(passed.y), share(passed.z)};
    path.behind = behind_caught(queue, k);
    path.with += with[i];
    path.without += caught_[i].glow + take_sums(k);
    see_lights(k);
  }
}

/// The surroundings behind a catcher's point, where they are seen.
Vec3d Tracer::behind_caught(const Queue& queue, uint32_t k) {
  if (scene_.world.transparent_film || film_.wants(GLINT_PASS_SHADOW_CATCHER)) return {};
  if (!scene_.world.sky_program) return scene_.world.background;
  const double* const slot = run_sky(queue, &k, 1);
  Vec3d behind;
  for (int c = 0; c < 3; ++c) {
    const double radiance = slot[size_t(c) * kBlock];
    behind[c] = std::isfinite(radiance) ? radiance : 0;
  }
  return behind;
}

/// What bounced to catchers.
void Tracer::keep_caught(const Queue& queue) {
  for (uint32_t k = 0; k < queue.size(); ++k) {
    CaughtPath& path = caught_paths_[queue.slot(k)];
    (queue.past.caught == Queue::Past::kWithAll ? path.with : path.without) +=
        row(batch_.sums.total, k);
  }
}

/// The surroundings behind the catchers of each path, and over them a shadow as dark as the ratio
/// of their light says; or nothing, where the pass has the ratio.
void Tracer::show_caught() {
  double* const lost = paths_.lost_alpha();
  const bool has_pass = film_.wants(GLINT_PASS_SHADOW_CATCHER);
  const auto add = [&](double* sums, size_t path, Vec3d c) {
    for (size_t i = 0; sums && i < 3; ++i) sums[i * paths_.stride() + path] += c[int(i)];
  };
  for (size_t k = 0; k < paths_.size(); ++k) {
    const CaughtPath& path = caught_paths_[k];
    if (!any(path.seen)) continue;
    Vec3d left{caught_ratio(path.with.x, path.without.x), caught_ratio(path.with.y, path.without.y),
               caught_ratio(path.with.z, path.without.z)},
        unshaded = path.seen;
    if (has_pass) {
      lost[k] += mean(path.seen);
    } else {
      const double light = std::clamp(mean(left), 0.0, 1.0);
      left = {light, light, light};
      if (scene_.world.transparent_film) lost[k] += light * mean(path.seen);
      else unshaded = path.seen * path.behind;
    }
    add(paths_.sums(film_, GLINT_PASS_SHADOW_CATCHER), k, left * unshaded - unshaded);
    add(paths_.sums(film_, kUnshaded), k, unshaded);
    add(paths_.sums(film_, kCaughtLight), k, path.with);
    add(paths_.sums(film_, kCaughtAlone), k, path.without);
    if (has_pass || scene_.world.transparent_film) continue;
    const Vec3d seen = left * unshaded;
    add(paths_.sums(film_, GLINT_PASS_COMBINED), k, seen);
    add(paths_.sums(film_, GLINT_PASS_ENVIRONMENT), k, seen);
    double* const groups = paths_.sums(film_, GLINT_PASS_LIGHT_GROUPS);
    if (groups && scene_.world.light_group >= 0)
      add(groups + 3 * size_t(scene_.world.light_group) * paths_.stride(), k, seen);
  }
}

}  // namespace glint
