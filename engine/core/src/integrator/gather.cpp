// Light that surfaces throw onto each other: from each point one ray goes on where what is matt
// there scatters light to; what it meets is lit and scatters the next (Kajiya 1986, The rendering
// equation).
#include <algorithm>

#include "integrator/tracer.h"
#include "math/math.h"

namespace glint {

void DirectLight::bounce(const Batch& batch, const std::vector<uint32_t>& pixels, uint32_t sample,
                         Queue& gathering, RayCounts& counts) {
  const Queue& queue = *batch.queue;
  const uint32_t bounced = queue.past.bounced;
  const double* at[RenderPlan::kBounceParts];
  for (uint32_t part = 0; part < RenderPlan::kBounceParts; ++part)
    at[part] = plan_.bounce_point(sample, bounced, part);
  place_.resize(batch.size());
  for (size_t k = 0; k < batch.size(); ++k) {
    place_[k] = uint8_t(plan_.bounce_part(pixels[k]));
    for (size_t c = 0; c < 2; ++c) disc_[c][k] = at[place_[k]][c];
  }
  OnwardStage stage = onward(batch.lit.data());
  stage.gathers_gloss = shows_even_gloss(queue);
  stage.chooses = scene_.instances.has_strands ? choices(batch, at) : nullptr;
  stage.fibres_alone = !bounces(queue);
  const size_t count = stages_.gather(stage);
  for (uint32_t part = 0; part < RenderPlan::kBounceParts; ++part)  // of one direction together
    for (size_t k = 0; k < count; ++k) {
      const uint32_t from = point_[k];
      if (place_[from] != part) continue;
      const bool chosen = scene_.instances.has_strands && choices_[from] >= 0;
      Path path = queue.path(from);
      const double whole = max_abs(path.T);
      path.T = row(rays_.diffuse, k);
      if (!finite(path.T)) continue;
      if (batch.soft_light) batch.mark_soft_light(from, Refinement::kReached);
      // of what bounced before, as much goes on as the surface gives back (Russian roulette)
      const double share = bounced > 0 ? std::min(max_abs(path.T) / whole, 1.0) : 1;
      if (!((chosen ? rays_.t_max[k] : at[part][2]) < share)) continue;
      path.T = (1 / share) * path.T;
      if (chosen) send(path, rays_.o, k, k, gathering, counts);  // which may be behind the strand
      else send(path, batch.points.x, from, k, gathering, counts);
    }
}

/// Whether gloss shows some light as if it were matt at what the rays of a queue meet.
bool DirectLight::shows_even_gloss(const Queue& queue) const {
  const MaterialTable& all = scene_.materials;
  return queue.gathers() ? all.has_toon_gloss || all.has_gloss || all.has_mirrors
                         : all.has_even_gloss(plan_.reflections == GLINT_REFLECT_ALL);
}

/// The numbers that choose lobes of points on strands.
const double* DirectLight::choices(const Batch& batch,
                                   const double* const (&at)[RenderPlan::kBounceParts]) {
  choices_.assign(columns_.rows(), -1.0);
  for (size_t k = 0; k < batch.size(); ++k)
    if (batch.lit[k] && is_on_strand(batch, k)) choices_[k] = at[place_[k]][2];
  return choices_.data();
}

/// Row k of the stage, from a point of the batch.
void DirectLight::send(Path& path, const double* const (&x)[3], uint32_t from, size_t k,
                       Queue& gathering, RayCounts& counts) const {
  path.start = row(x, from);
  path.from = 0;
  path.straight = 0;
  path.wants_data = false;
  path.skyless = true;
  path.widest = std::min(path.widest, RenderPlan::kBouncedExponent);
  path.depth = uint8_t(std::min(path.depth + 1, 255));
  gathering.push({row(rays_.o, k), row(rays_.to, k), 0, kInfinity, kDiffuse}, path);
  ++counts.gather;
}

bool DirectLight::is_on_strand(const Batch& batch, size_t k) const {
  const auto& all = scene_.instances;
  return all.has_strands && all.geometry(all.group(batch.instance[k])).kind == GLINT_STRANDS;
}

/// Rays that bounced show what lights throw on surfaces, and nothing that these give of themselves.
void Tracer::clear_own_light(const Queue& queue) {
  for (double* const* sums :
       {batch_.sums.total, batch_.sums.ambient, batch_.sums.emission, batch_.sums.environment})
    for (size_t c = 0; sums[0] && c < 3; ++c) std::fill_n(sums[c], queue.size(), 0.0);
}

/// The batch's light to the parts of the picture: that of surfaces that camera rays meet.
void Tracer::keep_gathered(const Queue& queue) {
  for (const bool seen : {true, false}) {
    double* const sums = paths_.sums(film_, seen ? GLINT_PASS_DIFFUSE : GLINT_PASS_MIRROR);
    for (size_t c = 0; sums && c < 3; ++c)
      for (size_t k = 0; k < queue.size(); ++k)
        if ((queue.depth(k) == queue.past.bounced) == seen)
          sums[c * paths_.stride() + queue.slot(k)] += batch_.sums.total[c][k];
  }
}

}  // namespace glint
