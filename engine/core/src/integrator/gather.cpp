// Bounced light from near by: each sample of a point looks along rays for what throws light on it
// (final gathering), where the few points that stand for all of it would be spots, and blur the
// shadows of what they lie on (Kollig and Keller 2004, Illumination in the presence of weak
// singularities).
#include <algorithm>

#include "integrator/tracer.h"
#include "math/math.h"

namespace glint {
namespace {

constexpr double kNearShare = 0.5;  // of 1 − d² / R²: pixels wait for more light samples

}  // namespace

/// What surfaces that mirrors show get of bounced light is told apart as well, but not what rough
/// reflections show.
bool DirectLight::gathers(const Queue& queue) const {
  if (plan_.bounces > 0) return queue.bounced < plan_.bounces;
  return reach_ > 0 && !queue.gathers && queue.reflections == 0;
}

void DirectLight::bounce(const Batch& batch, const std::vector<uint32_t>& pixels, uint32_t sample,
                         Queue& gathering, RayCounts& counts) {
  const Queue& queue = *batch.queue;
  look_around();
  const double* at[RenderPlan::kBounceParts];
  for (uint32_t part = 0; part < RenderPlan::kBounceParts; ++part)
    at[part] = plan_.bounce_point(sample, queue.bounced, part);
  place_.resize(batch.size());
  for (size_t k = 0; k < batch.size(); ++k) {
    place_[k] = uint8_t(plan_.bounce_part(pixels[k]));
    for (size_t c = 0; c < 2; ++c) disc_[c][k] = at[place_[k]][c];
  }
  const bool before = stage_.matt_alone;
  stage_.gathers_lobes = stage_.matt_alone = true;
  const size_t count = stages_.gather(stage_);
  stage_.gathers_lobes = false;
  stage_.matt_alone = before;
  for (uint32_t part = 0; part < RenderPlan::kBounceParts; ++part)  // of one direction together
    for (size_t k = 0; k < count; ++k) {
      const uint32_t from = point_[k];
      if (place_[from] != part) continue;
      if (is_on_strand(batch, from)) continue;
      Path path = queue.path(from);
      const double whole = max_abs(path.T);
      path.T = row(stage_.diffuse_out, k);
      // of what bounced before, as much goes on as the surface gives back (Russian roulette)
      const double share = queue.bounced > 0 ? std::min(max_abs(path.T) / whole, 1.0) : 1;
      if (!finite(path.T) || !(at[place_[from]][2] < share)) continue;
      path.T = (1 / share) * path.T;
      send(path, batch, k, gathering, counts);
    }
}

/// A gather ray along the direction of row k of the stage.
void DirectLight::send(Path& path, const Batch& batch, size_t k, Queue& gathering,
                       RayCounts& counts) const {
  path.start = row(batch.points.x, point_[k]);
  path.from = 0;
  path.straight = 0;
  path.wants_data = false;
  path.skyless = true;
  path.depth = uint8_t(std::min(path.depth + 1, 255));
  gathering.push({row(stage_.o, k), row(stage_.to, k), 0, reach_, kDiffuse}, path);
  ++counts.gather;
}

bool DirectLight::is_on_strand(const Batch& batch, size_t k) const {
  const auto& all = scene_.instances;
  return all.has_strands && all.geometry(all.group(batch.instance[k])).kind == GLINT_STRANDS;
}

void DirectLight::gather(const Batch& batch, const std::vector<uint32_t>& pixels, uint32_t sample,
                         Queue& gathering, const BlockShares* blocks, RayCounts& counts) {
  if (plan_.bounces > 0) return bounce(batch, pixels, sample, gathering, counts);
  const Queue& queue = *batch.queue;
  look_around();
  place_.resize(batch.size());
  for (size_t k = 0; k < batch.size(); ++k) place_[k] = uint8_t(plan_.gather_place(pixels[k]));
  const uint32_t places = plan_.gather_block * plan_.gather_block, each = plan_.gather_places.each;
  for (uint32_t j = 0; j < each; ++j) {
    for (size_t k = 0; k < batch.size(); ++k) {
      const double* const at = plan_.gather_point(place_[k], sample, j);
      for (size_t c = 0; c < 2; ++c) disc_[c][k] = at[c];
    }
    const size_t count = stages_.gather(stage_);
    for (uint32_t place = 0; place < places; ++place)  // rays of one direction go down together
      for (size_t k = 0; k < count; ++k) {
        const uint32_t from = point_[k];
        if (place_[from] != place) continue;
        Path path = queue.path(from);
        const bool is_shared = blocks && blocks->shares(from);
        path.T = (1.0 / each) * (is_shared ? Vec3d{1, 1, 1} : row(stage_.diffuse_out, k));
        if (!finite(path.T)) continue;
        send(path, batch, k, gathering, counts);
      }
  }
}

/// The stage as `gather` of the stages reads it.
void DirectLight::look_around() {
  stage_.gathers_gloss = scene_.materials.has_even_gloss(plan_.reflections == GLINT_REFLECT_ALL);
}

void DirectLight::find_blocks(const Batch& batch, const std::vector<uint32_t>& pixels,
                              BlockShares& blocks) {
  prepare(batch);
  look_around();
  given_.assign(batch.size(), {});
  find_matt(batch);
  apart_.resize(batch.size());
  for (size_t k = 0; k < batch.size(); ++k) apart_[k] = any(given_[k]) && is_apart(batch, k);
  blocks.set(plan_, batch, pixels, {plan_.gather_block}, given_, &apart_, nullptr);
}

/// Whether the point asks the points of bounced light for their shadows itself: those of fibres,
/// that these light from behind as well, and of lights that light but some.
bool DirectLight::is_apart(const Batch& batch, size_t k) const {
  const Material& material = scene_.materials[batch.material[k]];
  return bounced_linked_ || material.has(GLINT_FIBRE_DIFFUSE) ||
         material.has(GLINT_FIBRE_SPECULAR) || material.has(GLINT_FIBRE_TRANSMISSION) ||
         is_on_strand(batch, k);
}

/// What points throw back of light from all sides, but for those that get less of some.
void DirectLight::find_matt(const Batch& batch) {
  for (size_t c = 0; c < 2; ++c) std::fill_n(disc_[c].begin(), batch.size(), 0.0);
  const size_t count = stages_.gather(stage_);
  for (size_t k = 0; k < count; ++k) {
    const uint32_t point = point_[k];
    const Vec3d matt = row(stage_.diffuse_out, k);
    const bool bent = stage_.unbent[0] && any(row(stage_.unbent, point));
    const bool lowers = stage_.lowering && stage_.lowering[point] > 1;
    if (finite(matt) && !bent && !lowers) given_[point] = matt;
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
  if (plan_.bounces == 0) return batch.clear_specular();
  if (scene_.materials.max_specular == 0) return;
  for (size_t k = 0; k < batch.size(); ++k)
    if (!batch.missed(k)) batch.clear_gloss(k, is_on_strand(batch, k));
}

/// They show what lights throw on surfaces, and nothing that these give of themselves: as much of
/// it as the points of bounced light do not have. Strands throw no light on.
void Tracer::make_diffuse(const Queue& queue) {
  for (double* const* sums :
       {batch_.sums.total, batch_.sums.ambient, batch_.sums.emission, batch_.sums.environment})
    for (size_t c = 0; sums[0] && c < 3; ++c) std::fill_n(sums[c], queue.size(), 0.0);
  direct_.make_diffuse(batch_);
  const double per_square = 1 / (direct_.reach() * direct_.reach());
  for (size_t k = 0; k < queue.size(); ++k) {
    const bool behind = batch_.translucent[0] && any(row(batch_.translucent, k));
    if (!batch_.lit[k] && !behind) continue;
    const Vec3d to = row(batch_.points.x, k) - queue.ray(k).o;
    const double rest = 1 - std::min(per_square * dot(to, to), 1.0);
    const double share = direct_.is_on_strand(batch_, k) ? 0 : rest * rest;
    bool gives = false;
    for (double* const* columns : {batch_.diffuse, batch_.translucent})
      for (size_t c = 0; columns[0] && c < 3; ++c) gives |= (columns[c][k] *= share) != 0;
    if (batch_.soft_light && rest >= kNearShare && gives)
      to_paths(queue, k,
               [&](uint32_t path, Vec3d) { batch_.soft_light[path] |= Refinement::kNear; });
  }
}

/// The batch's light to the parts of the picture: that of surfaces that camera rays meet.
void Tracer::keep_gathered(const Queue& queue) {
  for (const bool seen : {true, false}) {
    double* const sums = paths_.sums(film_, seen ? GLINT_PASS_DIFFUSE : GLINT_PASS_MIRROR);
    for (size_t k = 0; sums && k < queue.size(); ++k)
      if ((queue.depth(k) == queue.bounced) == seen)
        add_to_paths(queue, k, batch_.sums.total, sums);
  }
}

}  // namespace glint
