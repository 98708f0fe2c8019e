#include "integrator/layers_ahead.h"

#include <algorithm>

#include "scene/surface.h"

namespace glint {
namespace {

constexpr int kPlain = 1;  // generations: most surfaces with alpha stop rays there

void answer(const Hit& hit, size_t k, const Hits& hits) {
  hits.t[k] = hit.t;
  hits.instance[k] = hit.instance;
  hits.primitive[k] = hit.primitive;
  hits.u[k] = hit.u;
  hits.v[k] = hit.v;
}

}  // namespace

void LayersAhead::closest(const Queue& queue, const Hits& hits) {
  if (generation_++ < kPlain) {
    Rays rays = queue.rays();
    rays.opacity = scene_.trees.opacity();
    return scene_.trees.accel().closest(rays, hits, scratch_);
  }
  if (generation_ == kPlain + 1) {
    ahead_.assign(paths_, {});
    hits_.resize(std::max(hits_.size(), paths_ * kMost));
  }
  list_unknown(queue, hits);
  if (!rows_.empty()) look_ahead(queue, hits);
}

void LayersAhead::list_unknown(const Queue& queue, const Hits& hits) {
  rows_.clear();
  for (uint32_t k = 0; k < queue.size(); ++k)
    if (!take_known(queue.slot(k), queue.t_min[k], k, hits)) rows_.push_back(k);
}

/// The first hit behind t_min to row k, or none; false where it is not known.
bool LayersAhead::take_known(uint32_t slot, double t_min, size_t k, const Hits& hits) {
  Ahead& ahead = ahead_[slot];
  const Hit* const known = hits_.data() + size_t(slot) * kMost;
  while (ahead.next < ahead.end && !(known[ahead.next].t > t_min)) ++ahead.next;
  if (ahead.next == ahead.end && !ahead.last) return false;
  answer(ahead.next < ahead.end ? known[ahead.next++] : Hit{HUGE_VAL}, k, hits);
  return true;
}

/// Up to the nearest surface that is solid, that one included.
void LayersAhead::look_ahead(const Queue& queue, const Hits& hits) {
  const size_t count = rows_.size();
  rays_.reserve(count);
  for (auto* v : {&instance_, &primitive_}) v->resize(count);
  for (auto* v : {&u_, &v_}) v->resize(count);
  found_.resize(count * kMost);
  count_.resize(count);
  blocked_.resize(count);
  const Rays at = queue.rays();
  const double* const from[] = {at.o[0], at.o[1], at.o[2],  at.d[0],
                                at.d[1], at.d[2], at.t_min, at.t_max};
  for (size_t c = 0; c < kT; ++c)
    for (size_t i = 0; i < count; ++i) rays_[c][i] = from[c][rows_[i]];
  Opacity onward = *scene_.trees.opacity();
  onward.onward = true;
  const Rays rays{{rays_[kO], rays_[kO + 1], rays_[kO + 2]},
                  {rays_[kD], rays_[kD + 1], rays_[kD + 2]},
                  rays_[kTMin],
                  rays_[kTMax],
                  count,
                  queue.visibility,
                  &onward};
  scene_.trees.accel().closest(
      rays, {rays_[kT], instance_.data(), primitive_.data(), u_.data(), v_.data()}, scratch_);
  for (size_t i = 0; i < count; ++i)
    rays_[kTMax][i] = std::min(rays_[kTMax][i], beyond(beyond(rays_[kT][i])));
  scene_.trees.accel().find_layers(rays, {found_.data(), count_.data()}, blocked_.data(), scratch_);
  keep(queue, hits);
}

/// What was found, and the first of it as hits.
void LayersAhead::keep(const Queue& queue, const Hits& hits) {
  for (size_t i = 0; i < rows_.size(); ++i) {
    const uint32_t slot = queue.slot(rows_[i]);
    const uint8_t end = std::min<uint8_t>(count_[i], kMost);
    std::copy_n(found_.data() + i * kMost, end, hits_.data() + size_t(slot) * kMost);
    ahead_[slot] = {0, end, instance_[i] == Hit::kNone && count_[i] <= kMost};
    if (!take_known(slot, rays_[kTMin][i], rows_[i], hits))
      answer({rays_[kT][i], instance_[i], primitive_[i], u_[i], v_[i]}, rows_[i], hits);
  }
}

}  // namespace glint
