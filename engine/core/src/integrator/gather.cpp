// Light that surfaces throw onto each other: from each point one ray goes on where what is matt
// there scatters light to; what it meets is lit and scatters the next (Kajiya 1986, The rendering
// equation).
#include <algorithm>

#include "integrator/tracer.h"
#include "math/math.h"

namespace glint {

void DirectLight::bounce(const Batch& batch, const std::vector<uint32_t>& pixels, uint32_t sample,
                         Queue& gathering, Queue* around, RayCounts& counts) {
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
  stage_.gathers_gloss = scene_.materials.has_even_gloss(plan_.reflections == GLINT_REFLECT_ALL);
  stage_.side = around ? choose_sides(batch, at) : nullptr;
  const bool before = stage_.matt_alone;
  stage_.matt_alone = true;
  const size_t count = stages_.gather(stage_);
  stage_.matt_alone = before;
  for (uint32_t part = 0; part < RenderPlan::kBounceParts; ++part)  // of one direction together
    for (size_t k = 0; k < count; ++k) {
      const uint32_t from = point_[k];
      if (place_[from] != part) continue;
      Path path = queue.path(from);
      const double whole = max_abs(path.T);
      path.T = row(stage_.diffuse_out, k);
      if (!finite(path.T)) continue;
      if (batch.soft_light) batch.mark_soft_light(from, Refinement::kReached);
      if (around && is_on_strand(batch, from)) {
        send(path, batch.points.x, from, k, kSolid, *around, counts);
        continue;
      }
      // of what bounced before, as much goes on as the surface gives back (Russian roulette)
      const double share = bounced > 0 ? std::min(max_abs(path.T) / whole, 1.0) : 1;
      if (!(at[part][2] < share)) continue;
      path.T = (1 / share) * path.T;
      send(path, batch.points.x, from, k, kDiffuse, gathering, counts);
    }
}

/// Of strands that let light pass the rays of one half go to the back.
const double* DirectLight::choose_sides(const Batch& batch,
                                        const double* const (&at)[RenderPlan::kBounceParts]) {
  side_.assign(columns_.rows(), 0.0);
  for (size_t k = 0; k < batch.size(); ++k) {
    if (!batch.lit[k] || !is_on_strand(batch, k)) continue;
    const bool passes = scene_.materials[batch.material[k]].has(GLINT_FIBRE_TRANSMISSION);
    side_[k] = !passes ? 1 : at[place_[k]][2] < 0.5 ? 2 : -2;
  }
  return side_.data();
}

/// Row k of the stage, from a point of the batch.
void DirectLight::send(Path& path, const double* const (&x)[3], uint32_t from, size_t k,
                       uint32_t visibility, Queue& gathering, RayCounts& counts) const {
  path.start = row(x, from);
  path.from = 0;
  path.straight = 0;
  path.wants_data = false;
  path.skyless = true;
  path.depth = uint8_t(std::min(path.depth + 1, 255));
  gathering.push({row(stage_.o, k), row(stage_.to, k), 0, kInfinity, visibility}, path);
  ++counts.gather;
}

bool DirectLight::is_on_strand(const Batch& batch, size_t k) const {
  const auto& all = scene_.instances;
  return all.has_strands && all.geometry(all.group(batch.instance[k])).kind == GLINT_STRANDS;
}

void DirectLight::dim_by_strands(Queue& queue, const Batch& batch, RayCounts& counts) {
  prepare(batch);
  size_t count = 0;
  for (uint32_t k = 0; k < queue.size(); ++k) {
    if (batch.missed(k)) continue;
    const Ray ray = queue.ray(k);
    const Vec3d end = ray.o + batch.t[k] * ray.d;
    point_[count] = k;
    set_row(stage_.o, count, ray.o);
    set_row(stage_.to, count, ray.d);
    stage_.t_max[count] = batch.t[k] - rounding(std::max(max_abs(ray.o), max_abs(end)));
    ++count;
  }
  if (glassy_) {
    LightStage stage = stage_;
    stage.shape = kDirection;
    std::copy_n(stage_.o, 3, stage.start_out);
    transparent_shadows_.trace(stage, scene_.trees.opacity(), zeros_, count, shadow_, counts, true,
                               kDiffuse);
  } else {
    Rays rays = shadow_rays(count);
    rays.visibility = kDiffuse;
    scene_.trees.accel().occluded(rays, blocked_.data(), scratch_);
    counts.shadow += count;
  }
  for (size_t i = 0; i < count; ++i) {
    const Vec3d passed = glassy_ ? row(shadow_, i) : Vec3d{1, 1, 1} * double(!blocked_[i]);
    for (size_t c = 0; c < 3; ++c) queue.column(Queue::kT + c)[point_[i]] *= passed[int(c)];
  }
}

void DirectLight::make_diffuse(Batch& batch) {
  prepare(batch);
  if (scene_.materials.has_even_gloss(false)) {
    linked_.assign(batch.lit.begin(), batch.lit.end());
    for (size_t k = 0; k < batch.size(); ++k)
      if (linked_[k] && !scene_.materials[batch.material[k]].is_varnished) linked_[k] = 0;
    stage_.lit = linked_.data();
    stage_.gathers_gloss = true;
    stage_.shown = 0;
    stages_.make_diffuse(stage_, batch.diffuse);
  }
  if (scene_.materials.max_specular == 0) return;
  for (size_t k = 0; k < batch.size(); ++k)
    if (!batch.missed(k)) batch.clear_gloss(k, is_on_strand(batch, k));
}

/// Rays that bounced show what lights throw on surfaces, and nothing that these give of themselves.
/// Strands throw no light on.
void Tracer::make_diffuse(const Queue& queue) {
  for (double* const* sums :
       {batch_.sums.total, batch_.sums.ambient, batch_.sums.emission, batch_.sums.environment})
    for (size_t c = 0; sums[0] && c < 3; ++c) std::fill_n(sums[c], queue.size(), 0.0);
  direct_.make_diffuse(batch_);
  if (!scene_.instances.has_strands) return;
  for (size_t k = 0; k < queue.size(); ++k) {
    if (batch_.missed(k) || !direct_.is_on_strand(batch_, k)) continue;
    set_row(batch_.diffuse, k, {});
    if (batch_.translucent[0]) set_row(batch_.translucent, k, {});
  }
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
