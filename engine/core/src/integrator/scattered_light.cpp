#include "integrator/scattered_light.h"

#include <algorithm>

#include "math/math.h"

namespace glint {
namespace {

/// The integral of e^(-sigma s) over a way; endless ways where nothing dims count for nothing.
double dimmed_way(double sigma, double way) {
  if (!(sigma > 0)) return way < kInfinity ? way : 0;
  const double depth = sigma * way;
  if (depth < 1e-5) return way * (1 - 0.5 * depth);
  return (1 - exponential(-depth)) / sigma;
}

/// What pieces of a ray give of themselves.
Vec3d glow_of(const std::vector<MediaSpans::Piece>& pieces) {
  Vec3d sum, before;
  for (const MediaSpans::Piece& piece : pieces) {
    const double way = piece.to - piece.from;
    for (int c = 0; c < 3; ++c) {
      const double sigma = piece.extinction[c];
      if (piece.emission[c] != 0)
        sum[c] += piece.emission[c] * exponential(-before[c]) * dimmed_way(sigma, way);
      if (sigma > 0) before[c] += sigma * way;
    }
  }
  return sum;
}

/// The direction for a point of the unit disc: as many go to each part of the sphere.
Vec3d on_ball(double x, double y) {
  const double r2 = std::min(x * x + y * y, 1.0), across = 2 * std::sqrt(1 - r2);
  return {across * x, across * y, 1 - 2 * r2};
}

/// Balls of a medium light's points are so much wider where each has a ray (WIDER of
/// engine/reference/glowing_media.py).
constexpr double kFewerWider = 2;

/// In how many parts the samples of what is endlessly far are taken, one by each pixel sample in
/// turn: as many as leave `least` in each.
uint32_t parts_of_light(uint32_t samples, uint32_t least) {
  uint32_t parts = std::max(samples / std::max(least, 1u), 1u);
  while (samples % parts != 0) --parts;
  return parts;
}

}  // namespace

void ScatteredLight::add_glow(const CrossedMedia& media) {
  const auto& [batch, spans, clear] = media;
  if (spans.empty() || !scene.media.emits || batch.queue->gathers()) return;
  find_ends(batch);
  const double* const begin = batch.queue->t_min;
  for (size_t k = 0; k < batch.size(); ++k) {
    spans.list_pieces(k, begin[k], ends_[k], pieces_);
    const Vec3d glow = glow_of(pieces_);
    if (!any(glow)) continue;
    batch.add(k, batch.sums.emission, clear[k] * glow);
    for (int group = 0; group < int(batch.group_count()); ++group) {
      spans.list_pieces(k, begin[k], ends_[k], pieces_, &group);
      batch.add_to_group(group, k, clear[k] * glow_of(pieces_));
    }
  }
}

void ScatteredLight::find_ends(const Batch& batch) {
  ends_.resize(batch.size());
  for (size_t k = 0; k < batch.size(); ++k) ends_[k] = batch.missed(k) ? kInfinity : batch.t[k];
}

/// What the stage reads of points on the rays instead of those on surfaces.
void ScatteredLight::place_points(const Batch& batch) {
  columns_.reserve(batch.size());
  scatters_.assign(columns_.rows(), 0);  // also beyond the last ray, where stages look
  at_.resize(columns_.rows());
  for (size_t c = 0; c < 3; ++c) {
    lit_.rays.origin[c] = lit_.points.x[c] = lit_.points.origin[c] = columns_[c];
    lit_.points.diffuse[c] = columns_[3 + c];
    lit_.rays.start[c] = nullptr;
  }
  lit_.ask_ends(true);
  lit_.points.lobes.highlights = 0;
  lit_.points.lobes.other_count = 0;
}

void ScatteredLight::add(const CrossedMedia& media, const std::vector<uint32_t>& pixels,
                         uint32_t sample, Queue& gathering) {
  const auto& [batch, spans, clear] = media;
  if (spans.empty() || !scene.media.scatters) return;
  find_ends(batch);
  depths_.build(spans, batch.queue->rays(), ends_.data());
  if (!depths_.any()) return;
  lit_.begin(batch, sample, false);
  place_points(batch);
  for (size_t k = 0; batch.soft_light && k < batch.size(); ++k)
    if (depths_.any(k)) batch.mark_soft_light(k, Refinement::kReached | Refinement::kCut);
  lit_.scattering = true;
  for (const Light& light : scene.lights)
    if (light.lights_media()) add_light(media, light, sample);
  lit_.scattering = false;
  if (plan.volume_bounces > 0 && batch.queue->past.bounced < plan.bounces)
    bounce(media, pixels, sample, gathering);
}

/// From a place on each ray one goes on to where light comes from that surfaces throw there, to all
/// sides alike.
void ScatteredLight::bounce(const CrossedMedia& media, const std::vector<uint32_t>& pixels,
                            uint32_t sample, Queue& gathering) {
  const auto& [batch, spans, clear] = media;
  const Queue& queue = *batch.queue;
  const Rays rays = queue.rays();
  depths_.aim(nullptr, {true, {}, 0}, rays);
  const double share = plan.scatter_share(sample, 0, 1);
  for (uint32_t k = 0; k < batch.size(); ++k) {
    if (!depths_.any(k)) continue;
    const ScatterDepths::Place place = depths_.at(k, share);
    if (!(place.spread > 0)) continue;
    const double* const point =
        plan.bounce_point(sample, queue.past.bounced, plan.bounce_part(pixels[k]));
    const Vec3d d = row(rays.d, k), l = on_ball(point[0], point[1]);
    Path path = queue.path(k);
    path.T = 4 * kPi * place.spread *
             (spans.passed(k, rays.t_min[k], place.t) * clear[k] *
              spans.scattering(k, place.t, d, l, 0));
    if (!any(path.T) || !finite(path.T)) continue;
    const Vec3d x = row(rays.o, k) + place.t * d;
    lit_.push_gather_ray(path, x, x, l, gathering);
  }
}

void ScatteredLight::add_light(const CrossedMedia& media, const Light& light, uint32_t sample) {
  const Queue& queue = *media.batch.queue;
  const bool one = queue.gathers();  // each is of many
  const uint32_t all = light.is_medium() ? plan.medium_shadows : plan.samples_of(light),
                 least = one ? 1 : plan.volume_samples,
                 parts = one || light.endless() ? parts_of_light(all, least) : 1,
                 count = all / parts, each = (least + count - 1) / count;
  LampSample lamp{{}, lit_.policy_of(light), scatters_.data(), false};
  for (uint32_t j = 0; j < count && !cancel; ++j) {
    const LightPoint point = plan.light_point(light, sample, sample % parts * count + j);
    lamp.light = light.sample(point, all, plan.physical(), lamp.policy);
    lit_.group = point.group;
    double& near2 = light.is_medium() ? lamp.light.medium.near2 : lamp.light.mesh.near2;
    if (light.is_medium()) near2 *= kFewerWider * kFewerWider;
    if (light.is_tabled()) {
      const double* const at = lamp.light.center;
      depths_.aim(&light, {false, {at[0], at[1], at[2]}, 0.5 * std::sqrt(near2)}, queue.rays());
    } else if (j == 0) {
      depths_.aim(&light, {light.endless(), light.center, light.nearness()}, queue.rays());
    }
    for (uint32_t i = 0; i < each; ++i)
      add_sample(media, light, lamp, plan.scatter_share(sample, j * each + i, count * each),
                 double(each) / parts);
  }
}

/// One point on each ray, in the light of a sample. count: of points that it is for.
void ScatteredLight::add_sample(const CrossedMedia& media, const Light& light,
                                const LampSample& lamp, double share, double count) {
  const auto& [batch, spans, clear] = media;
  const Rays rays = batch.queue->rays();
  double* const x[3] = {columns_[0], columns_[1], columns_[2]};
  double* const weight[3] = {columns_[3], columns_[4], columns_[5]};
  for (size_t k = 0; k < batch.size(); ++k) {
    scatters_[k] = 0;
    if (!depths_.any(k)) continue;
    const ScatterDepths::Place place = depths_.at(k, share);
    if (!(place.spread > 0)) continue;
    const Vec3d T =
        kPi * place.spread / count * (spans.passed(k, rays.t_min[k], place.t) * clear[k]);
    scatters_[k] = any(T) && finite(T) ? -1 : 0;
    at_[k] = place.t;
    set_row(weight, k, T);
    set_row(x, k, row(rays.o, k) + place.t * row(rays.d, k));
  }
  const size_t reached = stages.scatter(lit_.points, lamp, lit_.rays);
  for (size_t i = 0; i < reached; ++i) {
    const uint32_t k = lit_.rays.point[i];
    const Vec3d at = spans.scattering(k, at_[k], row(rays.d, k), row(lit_.rays.to, i),
                                      light.excluded_sets),
                given = at * row(lit_.rays.diffuse, i);
    set_row(lit_.rays.diffuse, i, finite(given) ? given : Vec3d{});
  }
  lit_.add(batch, light, lamp.light, reached, nullptr);
}

}  // namespace glint
