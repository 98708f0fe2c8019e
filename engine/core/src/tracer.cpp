#include "tracer.h"

#include "math.h"

namespace glint {
namespace {

constexpr size_t kMaxBatch = 8192;  // rays in flight at once
constexpr uint32_t kBlock = 8;      // camera rays come in blocks of 8 x 8 pixels: groups of 64 stay narrow

}  // namespace

std::vector<Tile> tiles_of(const Region& region) {
  std::vector<Tile> tiles;
  for (uint32_t y = 0; y < region.height(); y += Tile::kSize)
    for (uint32_t x = 0; x < region.width(); x += Tile::kSize)
      tiles.push_back({x, y, std::min(x + Tile::kSize, region.width()), std::min(y + Tile::kSize, region.height())});
  return tiles;
}

Tracer::Tracer(const Scene& scene, const RenderPlan& plan, Film& film, const std::atomic<bool>& cancel)
    : scene_(scene), plan_(plan), film_(film), cancel_(cancel), camera_(scene), shader_(scene, plan, film),
      direct_(scene, plan, film, cancel) {}

Queue Tracer::take() {
  if (spare_.empty()) return {};
  Queue queue = std::move(spare_.back());
  spare_.pop_back();
  return queue;
}

void Tracer::give(Queue queue) {
  queue.clear();
  spare_.push_back(std::move(queue));
}

void Tracer::camera_rays(const Tile& tile, uint32_t sample, Queue& queue) {
  double dx = plan_.pixel_offsets[2 * size_t(sample)], dy = plan_.pixel_offsets[2 * size_t(sample) + 1];
  Path path{{1, 1, 1}, {}, 0, 0, 0, 0, sample == 0 && film_.wants_data()};
  for (uint32_t by = tile.y0; by < tile.y1; by += kBlock)
    for (uint32_t bx = tile.x0; bx < tile.x1; bx += kBlock)
      for (uint32_t y = by; y < std::min(by + kBlock, tile.y1); ++y)
        for (uint32_t x = bx; x < std::min(bx + kBlock, tile.x1); ++x) {
          path.pixel = y * plan_.region.width() + x;
          Ray ray = camera_.through(plan_.region.x0 + x, plan_.region.y0 + y, dx, dy);
          path.start = ray.o;
          queue.push(ray, path);
        }
  work_.counts.camera += queue.size();
}

void Tracer::trace(const Tile& tile, uint32_t sample) {
  waiting_.push_back(take());
  camera_rays(tile, sample, waiting_.back());
  while (!waiting_.empty() && !cancel_) {
    Queue queue = std::move(waiting_.back());
    waiting_.pop_back();
    if (queue.size() > kMaxBatch) {
      std::vector<Queue> pieces = split(queue, kMaxBatch);
      for (size_t k = pieces.size(); k-- > 0;) waiting_.push_back(std::move(pieces[k]));
    } else {
      Queue next = take();
      process(queue, sample, next);
      if (next.size() > 0) waiting_.push_back(std::move(next));
      else give(std::move(next));
    }
    give(std::move(queue));
  }
  waiting_.clear();
}

/// A counting sort of the rays that hit something, stable.
void Tracer::sort_by_material(const Queue& queue) {
  size_t misses = scene_.materials.size();
  material_.resize(queue.size()), order_.resize(queue.size()), first_.assign(misses + 2, 0);
  for (size_t k = 0; k < queue.size(); ++k) {
    const Hit& hit = hits_[k];
    material_[k] = hit.instance == Hit::kNone ? uint32_t(misses) : scene_.material_of(scene_.group(hit.instance), hit.primitive);
    ++first_[material_[k] + 1];
  }
  for (size_t m = 1; m < first_.size(); ++m) first_[m] += first_[m - 1];
  for (size_t k = 0; k < queue.size(); ++k) order_[first_[material_[k]]++] = uint32_t(k);
}

void Tracer::process(const Queue& queue, uint32_t sample, Queue& next) {
  hits_.resize(queue.size());
  scene_.accel().closest(queue.rays.data(), hits_.data(), queue.size());
  sort_by_material(queue);
  work_.clear();
  bool seen_lights = scene_.features & GLINT_FEATURE_SEEN_LIGHTS;
  for (uint32_t k : order_) {
    const Ray& ray = queue.rays[k];
    const Path& path = queue.paths[k];
    const Hit& hit = hits_[k];
    bool missed = hit.instance == Hit::kNone;
    if (seen_lights) shader_.seen_lights(ray, path, missed ? kInfinity : hit.t);
    if (missed) shader_.miss(path);
    else shader_.hit(ray, path, hit.t, surface_at(scene_, path.start, ray.d, hit), scene_.materials[material_[k]], work_, next);
  }
  direct_.illuminate(work_, sample);
}

}  // namespace glint
