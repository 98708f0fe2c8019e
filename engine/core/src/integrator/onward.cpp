// Light bounces: from each point one ray goes on where what is matt there scatters light to; what
// it hits is lit and scatters the next (Kajiya 1986, The rendering equation).
#include "integrator/onward.h"

#include <algorithm>

#include "math/math.h"

namespace glint {

void OnwardRays::bounce(const Batch& batch, const std::vector<uint32_t>& pixels, uint32_t sample,
                        Queue& gathering) {
  const Queue& queue = *batch.queue;
  const uint32_t bounced = queue.past.bounced;
  const double* at[RenderPlan::kBounceParts];
  for (uint32_t part = 0; part < RenderPlan::kBounceParts; ++part)
    at[part] = plan.bounce_point(sample, bounced, part);
  place_.resize(batch.size());
  for (std::vector<double>& column : disc_) column.resize(lit_.rows());
  for (size_t k = 0; k < batch.size(); ++k) {
    place_[k] = uint8_t(plan.bounce_part(pixels[k]));
    for (size_t c = 0; c < 2; ++c) disc_[c][k] = at[place_[k]][c];
  }
  OnwardStage going = stage(batch.lit);
  going.gathers_gloss = lit_.shows_even_gloss(queue);
  going.chooses = scene.instances.has_strands ? choices(batch, at) : nullptr;
  going.fibres_alone = !bounces(queue);
  const size_t count = stages.gather(going);
  const ShadowRays& rays = lit_.rays;
  for (uint32_t part = 0; part < RenderPlan::kBounceParts; ++part)  // of one direction together
    for (size_t k = 0; k < count; ++k) {
      const uint32_t from = rays.point[k];
      if (place_[from] != part) continue;
      const bool chosen = scene.instances.has_strands && choices_[from] >= 0;
      Path path = queue.path(from);
      const double whole = max_abs(path.T);
      path.T = row(rays.diffuse, k);
      if (!finite(path.T)) continue;
      if (batch.soft_light) batch.mark_soft_light(from, Refinement::kReached);
      // of what bounced before, as much goes on as the surface gives back (Russian roulette)
      const double share = bounced > 0 ? std::min(max_abs(path.T) / whole, 1.0) : 1;
      if (!((chosen ? rays.t_max[k] : at[part][2]) < share)) continue;
      path.T = (1 / share) * path.T;
      const Vec3d o = row(rays.o, k), start = chosen ? o : row(batch.x, from);
      lit_.push_gather_ray(path, start, o, row(rays.to, k), gathering);
    }
}

/// The numbers that choose lobes of points on strands.
const double* OnwardRays::choices(const Batch& batch,
                                  const double* const (&at)[RenderPlan::kBounceParts]) {
  choices_.assign(lit_.rows(), -1.0);
  for (size_t k = 0; k < batch.size(); ++k)
    if (batch.lit[k] && batch.is_on_strand(k)) choices_[k] = at[place_[k]][2];
  return choices_.data();
}

/// At a place of the unit disc for all points.
void OnwardRays::place_all(const Batch& batch, double x, double y) {
  for (std::vector<double>& column : disc_) column.resize(lit_.rows());
  std::fill_n(disc_[0].begin(), batch.size(), x);
  std::fill_n(disc_[1].begin(), batch.size(), y);
}

size_t OnwardRays::draw_diffuse(const Batch& batch, const LampSample& lamp) {
  const DiscPlace& place = lamp.light.draws.place;
  const double r = std::sqrt(place.radius2);
  place_all(batch, r * place.azimuth[0], r * place.azimuth[1]);
  const size_t drawn = stages.gather(stage(lamp.lit));
  const ShadowRays& rays = lit_.rays;
  std::fill_n(rays.t_max, drawn, kInfinity);
  for (size_t k = 0; k < drawn; ++k) {
    const double cosine = dot(row(lit_.points.n, rays.point[k]), row(rays.to, k));
    rays.pdf[k] = cosine / kPi;
    set_row(rays.diffuse, k, cosine * row(rays.diffuse, k));
  }
  return drawn;
}

void OnwardRays::reflect(const Batch& batch, uint32_t sample, Queue& glossy) {
  const double* const place = plan.lobe_point(sample, batch.queue->past.reflections);
  place_all(batch, place[0], place[1]);
  const size_t count = stages.reflect(stage(batch.lit));
  for (size_t k = 0; k < count; ++k) push_reflected(batch, k, glossy);
}

/// The k-th of the rays that the stage's points reflect.
void OnwardRays::push_reflected(const Batch& batch, size_t k, Queue& glossy) {
  const ShadowRays& rays = lit_.rays;
  const uint32_t from = rays.point[k];
  Path path = batch.queue->path(from);
  path.T = row(rays.diffuse, k);
  const double weight = max_abs(path.T);
  if (path.depth >= plan.max_bounces || weight < plan.cutoff || !finite(path.T)) return;
  path.leave(row(batch.x, from));
  path.widen(rays.t_max[k]);
  ++path.depth;
  batch.mark_thrown(path.slot, path.T);
  if (batch.soft_light) batch.mark_soft_light(from, Refinement::kReached);
  glossy.push({row(rays.o, k), row(rays.to, k), 0, kInfinity, kMirror}, path);
  ++counts.mirror;
}

}  // namespace glint
