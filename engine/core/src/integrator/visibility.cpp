// Camera rays that light does not follow: how much of a pixel shows what is known from more of them
// than its light (Ragan-Kelley, Lehtinen, Chen, Doggett, Durand 2011, Decoupled sampling for
// graphics pipelines).
#include <algorithm>

#include "integrator/tracer.h"

namespace glint {

const MoreSeen* Tracer::see(const Tile& tile, std::vector<uint32_t> slots) {
  if (slots.empty()) return nullptr;
  tile_ = &tile;
  slots_.set(tile.width(), tile.height());
  const double* const sums = film_.sums(tile, GLINT_PASS_COMBINED);
  seen_.sums.assign(sums, sums + film_.columns() * tile.stride());
  seen_.rays = plan_.beyond_samples();
  active_ = slots;
  seen_.slots = std::move(slots);
  deal();
  is_first_ = surely_empty_ = false;
  for (uint32_t past = 0; past < plan_.beyond_samples(); ++past) {
    const auto sample_of = [&](uint32_t slot) { return plan_.sample_beyond(past, class_of(slot)); };
    for (size_t k = 0, end = 0; k < active_.size() && !cancel_; k = end) {
      const double* const offsets = offsets_of(active_[k]);
      const uint32_t dealt = sample_of(active_[k]);
      while (end < active_.size() && offsets_of(active_[end]) == offsets &&
             sample_of(active_[end]) == dealt)
        ++end;
      points_.set(camera_, plan_, tile, {offsets, plan_.samples + past, 1, past % plan_.samples});
      see_some(active_.data() + k, active_.data() + end, dealt);
    }
  }
  for (int pass : {GLINT_PASS_COST, GLINT_PASS_FALLBACKS})
    if (double* const to = film_.sums(tile, pass))
      std::copy_n(seen_.sums.data() + (to - sums), tile.pixels(), to);
  return &seen_;
}

/// Of the slots [begin, end), with what samples draw of that one of the tables.
void Tracer::see_some(const uint32_t* begin, const uint32_t* end, uint32_t sample) {
  sample_ = sample;
  paths_.choose(film_, slots_, begin, end, points_, true);
  batch_.cost = paths_.sums(film_, GLINT_PASS_COST);
  batch_.fallbacks = paths_.sums(film_, GLINT_PASS_FALLBACKS);
  batch_.thrown = nullptr;
  batch_.soft_light = nullptr;
  start_paths();
  ahead_.begin(paths_.size());
  camera_rays();
  Queue now = take(kCamera, {}), next = take(kCamera, {});
  see_surfaces(first_, next);
  while (next.size() > 0 && !cancel_) {
    std::swap(now, next);
    next.clear();
    see_surfaces(now, next);
  }
  give(std::move(now));
  give(std::move(next));
  paths_.add_alone(film_, seen_.sums.data(), tile_->stride());
}

/// What the queue's rays show but for light, and those that go straight on.
void Tracer::see_surfaces(Queue& queue, Queue& straight) {
  batch_.begin(queue);
  batch_.first_hits = nullptr;
  find_points(queue);
  batch_.charge();
  if (scene_.features & GLINT_FEATURE_MEDIA) {
    dim(queue);
    direct_.scattered.add_glow({batch_, media_, clear_.data()});
  }
  Queue bounced = take(kMirror, {});
  const RayCounts before = counts_;
  shade(queue, straight, bounced);
  counts_.mirror = before.mirror;  // these go nowhere
  counts_.refraction = before.refraction;
  give(std::move(bounced));
  note_guides(queue);
  note_colors(queue);
  if (film_.wants(GLINT_PASS_AMBIENT_OCCLUSION)) note_asked(queue);
  add_caustics(queue, false);  // other passes are of the samples
  const SumColumns& s = batch_.sums;
  const auto add = [&](int pass, double* const(&columns)[3], double* const* less) {
    double* const sums = paths_.sums(film_, pass);
    for (size_t c = 0; sums && columns[0] && c < 3; ++c)
      for (size_t k = 0; k < queue.size(); ++k)
        sums[c * paths_.stride() + queue.slot(k)] += columns[c][k] - (less ? less[c][k] : 0);
  };
  add(GLINT_PASS_COMBINED, s.total, s.ambient);
  add(GLINT_PASS_EMISSION, s.emission, nullptr);
  add(GLINT_PASS_ENVIRONMENT, s.environment, nullptr);
  if (subsurface_.on()) subsurface_.enter(batch_, sample_, [](uint32_t) { return true; });
  direct_.lit.hides = false;
  illuminate(queue);
  if (scene_.materials.has_translucent) light_behind(queue, nullptr);
  direct_.lit.hides = true;
}

}  // namespace glint
