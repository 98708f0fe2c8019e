#include "integrator/photon_tracer.h"

#include <algorithm>
#include <cmath>

#include "math/math.h"

namespace glint {
namespace {

constexpr uint32_t kAtOnce = 4096;  // photons

}  // namespace

PhotonTracer::PhotonTracer(const Scene& scene, const RenderPlan& plan, const Stages& stages)
    : scene_(scene),
      plan_(plan),
      stages_(stages),
      shader_(scene, plan, stages),
      queries_(scene, plan, stages, scratch_),
      media_(scene, scratch_),
      program_(scene, stages),
      batch_(scene, 0, false),
      slots_(size_t(scene.programs.most_slots) * kBlock) {}

void PhotonTracer::trace(const PhotonBeam& beam, uint32_t first, uint32_t last,
                         std::vector<Photon>& arrived) {
  beam_ = &beam;
  emit(first, last);
  while (now_.size() > 0 || later_.size() > 0) {
    follow(now_, arrived);
    follow(later_, arrived);
    std::swap(now_, next_);
    std::swap(later_, bent_);
    next_.clear();
    bent_.clear();
  }
}

void PhotonTracer::emit(uint32_t first, uint32_t last) {
  now_.clear();
  later_.clear();
  ways_.clear();
  for (uint32_t i = first; i < last; ++i) {
    const EmittedPhoton photon = beam_->photon(i);
    if (!(photon.share > 0)) continue;
    Path path;
    path.start = photon.o;
    path.slot = uint32_t(ways_.size());
    now_.push({photon.o, photon.d, 0, kInfinity, kShadow}, path);
    ways_.push_back({photon.at, photon.d, photon.share * beam_->light->color, beam_->choice(i)});
  }
  sums_.resize(ways_.size());
  before_.resize(ways_.size());
  row_of_.resize(ways_.size());
}

/// The queue's photons to their next surfaces, and from there.
void PhotonTracer::follow(Queue& queue, std::vector<Photon>& arrived) {
  if (queue.size() == 0) return;
  batch_.begin(queue);
  find_hits(queue);
  batch_.find_points(stages_, scene_.materials.nothing());
  if (scene_.features & GLINT_FEATURE_MEDIA) dim(queue);
  straight_.clear();
  turned_.clear();
  shade(queue);
  arrive(queue, arrived);
  go_on(queue);
}

void PhotonTracer::find_hits(const Queue& queue) {
  scene_.trees.accel().closest(queue.rays(), batch_.hits(), scratch_);
  if (beam_->light->passed_sets && queue.visibility == kShadow) pass_unlinked(queue);
}

/// What casts no shadow in the lamp's light does not stop it.
void PhotonTracer::pass_unlinked(const Queue& queue) {
  const auto passes = [&](size_t k) {
    const uint32_t i = batch_.instance[k];
    const bool is_caster = i >= beam_->caster->first && i < beam_->caster->last;
    return !batch_.missed(k) && !is_caster &&
           beam_->light->passed_sets >> scene_.instances.group(i).light_set & 1;
  };
  for (size_t k = 0; k < queue.size(); ++k)
    while (passes(k)) {
      Ray ray = queue.ray(k);
      ray.t_min = beyond(batch_.t[k]);
      Hit hit;
      scene_.trees.accel().closest(&ray, &hit, 1, scratch_);
      batch_.t[k] = hit.t;
      batch_.instance[k] = hit.instance;
      batch_.primitive[k] = hit.primitive;
      batch_.u[k] = hit.u;
      batch_.v[k] = hit.v;
    }
}

/// What media on the way leave of the photons.
void PhotonTracer::dim(Queue& queue) {
  const Rays rays = queue.rays();
  media_.find(rays, counts_);
  if (media_.empty()) return;
  ends_.resize(queue.size());
  for (size_t k = 0; k < queue.size(); ++k) ends_[k] = batch_.missed(k) ? kInfinity : batch_.t[k];
  media_.march(rays, ends_.data(), 0, RayKind::kBounced, counts_);
  for (size_t k = 0; k < queue.size(); ++k) {
    set_row(queue.T, k, media_.passed(k, rays.t_min[k], ends_[k]) * queue.weight(k));
  }
}

/// What the surfaces are made of, and all rays that leave them.
void PhotonTracer::shade(const Queue& queue) {
  const size_t others = stages_.shade(batch_.shading());
  for (size_t first = 0, count; first < others; first += count) {
    const uint32_t* const rows = batch_.others + first;
    const Material& material = scene_.materials[batch_.material[rows[0]]];
    EvaluateStage varying = batch_.evaluation(material, slots_.data());
    count = 1;
    while (first + count < others && batch_.material[rows[count]] == batch_.material[rows[0]])
      ++count;
    varying.rows = rows;
    varying.count = count;
    if (varying.program && varying.program->asks_rays)
      varying.queries = queries_.at(batch_, 0, counts_);
    const size_t leaving = stages_.vary(varying);
    if (leaving > 0) shader_.send_all(batch_, batch_.passing_rows, leaving, {straight_, turned_});
  }
}

/// Adds the photons that were mirrored or refracted where they meet what is matt.
void PhotonTracer::arrive(const Queue& queue, std::vector<Photon>& arrived) {
  if (queue.visibility == kShadow) return;
  for (size_t k = 0; k < queue.size(); ++k) {
    if (batch_.missed(k)) continue;
    const bool matt = (batch_.lit[k] && any(row(batch_.diffuse, k))) ||
                      (batch_.translucent[0] && any(row(batch_.translucent, k)));
    const Way& way = ways_[queue.slot(k)];
    const Vec3d flux = queue.weight(k) * way.color;
    if (!matt || !any(flux) || !finite(flux) || comes_straight(way, queue.ray(k).d)) continue;
    arrived.push_back({row(batch_.x, k), Vec3f(row(batch_.g, k)), Vec3f(flux)});
  }
}

/// Whether the lamp's own light is counted that takes this way as if nothing bent it.
bool PhotonTracer::comes_straight(const Way& way, Vec3d d) const {
  const Vec3d turned = d - way.d;
  const bool is_out = std::fabs(way.narrowed - 1) < TransparentShadows::kAlike;
  constexpr double most = TransparentShadows::kMostBent;
  return way.passed && (!is_out || dot(turned, turned) <= most * most);
}

/// Of the rays that leave a surface one goes on.
void PhotonTracer::go_on(const Queue& queue) {
  for (uint32_t k = 0; k < queue.size(); ++k) {
    row_of_[queue.slot(k)] = k;
    sums_[queue.slot(k)] = before_[queue.slot(k)] = 0;
  }
  const auto each = [&](auto body) {
    for (const Queue* rays : {&turned_, &straight_})
      for (size_t r = 0; r < rays->size(); ++r)
        if (const double size = allowed(queue, *rays, r); size > 0) body(*rays, r, size);
  };
  asks_.clear();
  each([&](const Queue& rays, size_t r, double size) { sums_[rays.slot(r)] += size; });
  each([&](const Queue& rays, size_t r, double size) {
    const uint32_t slot = rays.slot(r), k = row_of_[slot];
    Way& way = ways_[slot];
    // what was never bent goes on in any case; then as much as surfaces give back (roulette)
    const double whole =
        queue.visibility == kShadow ? sums_[slot] : std::max(sums_[slot], max_abs(queue.weight(k)));
    const double at = way.choice * whole, start = before_[slot];
    before_[slot] += size;
    if (!(at >= start && at < before_[slot])) return;
    before_[slot] = kInfinity;  // no other
    way.choice = std::min((at - start) / size, 0x1.fffffffffffffp-1);
    Path path = rays.path(r);
    path.T = (whole / size) * path.T;
    const bool turns = path.depth > queue.depth(k);
    if (turns) turn(way, path, k, rays.refracted(r));
    if (turns && queue.visibility == kShadow && beam_->light->program) asks_.push_back(slot);
    (path.depth > 0 ? bent_ : next_).push(rays.ray(r), path);
  });
  if (!asks_.empty()) apply_program(queue);
}

/// Notes that row k mirrored or refracted a photon.
void PhotonTracer::turn(Way& way, Path& path, size_t k, bool refracted) const {
  way.passed &= refracted && scene_.materials[batch_.material[k]].is_dense;
  if (!refracted) return;
  const double narrowed = narrowing(k);
  way.narrowed *= narrowed;
  path.T = narrowed * path.T;
}

/// How large a ray is that leaves a surface of the queue; 0 where it may not be.
double PhotonTracer::allowed(const Queue& queue, const Queue& rays, size_t ray) const {
  const uint32_t k = row_of_[rays.slot(ray)];
  const Vec3d T = rays.weight(ray);
  const double size = finite(T) ? max_abs(T) : 0;
  if (rays.depth(ray) == queue.depth(k)) return size;
  const bool refracted = rays.refracted(ray);
  if (!(refracted ? plan_.refractive_caustics : plan_.reflective_caustics)) return 0;
  if (refracted && scene_.materials[batch_.material[k]].is_rough_glass) return 0;
  if (queue.visibility != kShadow) return size;
  const uint32_t i = batch_.instance[k];
  const bool own = i >= beam_->caster->first && i < beam_->caster->last;
  return own && beam_->light->lights(scene_.instances.group(i).light_set) ? size : 0;
}

/// What a refracted photon is times, so that light in what is dense is counted as other light is
/// there: radiance over the square of the index stays.
double PhotonTracer::narrowing(size_t k) const {
  const Material& material = scene_.materials[batch_.material[k]];
  const LobeShape* lobe = scene_.materials.lobes.data() + material.first_lobe;
  int number = 0;
  for (; lobe->kind != GLINT_REFRACTION; ++lobe) number += (1u << lobe->kind & kPassing) != 0;
  const double ior = batch_.passing_ior(k, number, lobe->ior);
  return batch_.outside[k] ? 1 / (ior * ior) : ior * ior;
}

/// What the lamp's program says of its light where photons are bent first.
void PhotonTracer::apply_program(const Queue& queue) {
  const Light& light = *beam_->light;
  for (size_t first = 0; first < asks_.size(); first += kBlock) {
    const size_t count = std::min(kBlock, asks_.size() - first);
    for (size_t i = 0; i < (count + kPad - 1) / kPad * kPad; ++i) {
      const uint32_t slot = asks_[first + std::min(i, count - 1)], k = row_of_[slot];
      program_.put(light, i, row(batch_.x, k), -queue.ray(k).d, ways_[slot].from);
    }
    program_.run(light, RayKind::kShadow, count);
    for (size_t i = 0; i < count; ++i) {
      Way& way = ways_[asks_[first + i]];
      way.color = program_.share(light, i) * way.color;
    }
  }
}

std::shared_ptr<const PhotonMap> trace_photons(const Scene& scene, const RenderPlan& plan,
                                               const std::atomic<bool>& cancel) {
  if (!plan.throws_photons()) return nullptr;
  const std::vector<Caster> casters = find_casters(scene, plan);
  const std::vector<PhotonBeam> beams = find_beams(scene, plan, casters);
  if (beams.empty()) return nullptr;
  struct Part {
    size_t beam;
    uint32_t first, last;
    std::vector<Photon> arrived;
  };
  std::vector<Part> parts;
  for (size_t b = 0; b < beams.size(); ++b)
    for (uint32_t first = 0; first < beams[b].count; first += kAtOnce)
      parts.push_back({b, first, std::min(beams[b].count, first + kAtOnce), {}});
  ThreadPool pool(plan.thread_count);
  const size_t threads = std::min(pool.size(), parts.size());
  std::atomic<size_t> next{0};
  pool.run(threads, [&](size_t) {
    PhotonTracer tracer(scene, plan, best_stages());
    for (size_t k; !cancel && (k = next++) < parts.size();)
      tracer.trace(beams[parts[k].beam], parts[k].first, parts[k].last, parts[k].arrived);
  });
  std::vector<Photon> photons;
  std::vector<PhotonBundle> bundles;
  for (const Part& part : parts) {
    const PhotonBeam& beam = beams[part.beam];
    if (part.first == 0 && beam.place == 0)
      bundles.push_back({beam.light->group, photons.size(), {}});
    if (part.first == 0) bundles.back().ends.push_back(0);
    photons.insert(photons.end(), part.arrived.begin(), part.arrived.end());
    bundles.back().ends.back() = photons.size();
  }
  if (photons.empty() || cancel) return nullptr;
  return std::make_shared<const PhotonMap>(std::move(photons), std::move(bundles), pool);
}

}  // namespace glint
