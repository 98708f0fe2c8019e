#include "integrator/first_hit_cache.h"

#include <algorithm>
#include <cstring>

#include "scene/scene.h"

namespace glint {
namespace {

constexpr size_t kMostCaches = 2;  // a viewport shows a view and in it the render's frame

}  // namespace

FirstHitCache::FirstHitCache(const GlintCamera& camera, const RenderPlan& plan, const Film& film)
    : camera_(camera),
      region_(plan.region),
      offset_{plan.pixel_offsets[0], plan.pixel_offsets[1]},
      rows_(film.rows()),
      t_(rows_),
      instance_(rows_),
      primitive_(rows_),
      u_(rows_),
      v_(rows_),
      kept_(rows_) {}

bool FirstHitCache::is_of(const GlintCamera& camera, const RenderPlan& plan) const {
  const Region& r = plan.region;
  return std::memcmp(&camera, &camera_, sizeof camera) == 0 && r.x0 == region_.x0 &&
         r.y0 == region_.y0 && r.x1 == region_.x1 && r.y1 == region_.y1 &&
         plan.pixel_offsets[0] == offset_[0] && plan.pixel_offsets[1] == offset_[1];
}

bool FirstHitCache::Column::is_of(const LightSample& sample) const {
  const SamplePlace& other = sample;
  return shape == sample.shape && std::memcmp(&place, &other, sizeof place) == 0;
}

void FirstHitCache::expect(const Scene& scene, const RenderPlan& plan) {
  size_t number = 0;
  for (const Light& light : scene.lights) {
    // Each of their samples is asked by but some of the points.
    if (light.is_medium()) continue;
    const uint32_t count = plan.samples_of(light) + plan.opening_samples_of(light);
    for (uint32_t j = 0; j < count && number < kMaxColumns; ++j, ++number) {
      LampSample lamp{};
      plan.set_sample(lamp, light, 0, j);
      if (number < columns_.size() && columns_[number].is_of(lamp.light)) continue;
      if (number == columns_.size()) columns_.emplace_back();
      columns_[number] = {lamp.light.shape, lamp.light, ZeroedBuffer<uint8_t>(rows_)};
    }
  }
}

bool FirstHitCache::look_up(const Tile& tile, const Hits& hits) const {
  const size_t first = tile.first_row, count = tile.pixels();
  if (!kept_.data()[first]) return false;
  std::copy_n(t_.data() + first, count, hits.t);
  std::copy_n(u_.data() + first, count, hits.u);
  std::copy_n(v_.data() + first, count, hits.v);
  std::copy_n(instance_.data() + first, count, hits.instance);
  std::copy_n(primitive_.data() + first, count, hits.primitive);
  return true;
}

void FirstHitCache::keep(const Tile& tile, const Hits& hits) {
  const size_t first = tile.first_row, count = tile.pixels();
  std::copy_n(hits.t, count, t_.data() + first);
  std::copy_n(hits.u, count, u_.data() + first);
  std::copy_n(hits.v, count, v_.data() + first);
  std::copy_n(hits.instance, count, instance_.data() + first);
  std::copy_n(hits.primitive, count, primitive_.data() + first);
  kept_.data()[first] = 1;
}

std::shared_ptr<FirstHitCache> FirstHitCaches::of(const GlintCamera& camera, const RenderPlan& plan,
                                                  const Film& film) {
  std::lock_guard lock(mutex_);
  const auto found = std::find_if(caches_.begin(), caches_.end(),
                                  [&](const auto& cache) { return cache->is_of(camera, plan); });
  if (found != caches_.end()) std::rotate(caches_.begin(), found, found + 1);
  else caches_.insert(caches_.begin(), std::make_shared<FirstHitCache>(camera, plan, film));
  if (caches_.size() > kMostCaches) caches_.pop_back();
  return caches_.front();
}

void FirstHitCaches::share(const FirstHitCaches& other) {
  std::lock_guard lock(other.mutex_);
  caches_ = other.caches_;
}

}  // namespace glint
