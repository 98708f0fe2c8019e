// Passes of what camera rays see: data of the first surface, and means over surfaces (mist,
// Cryptomatte, what denoisers are told).
#include <algorithm>

#include "integrator/tracer.h"

namespace glint {

/// Data passes of the hits on materials that let nothing through.
void Tracer::record(const Queue& queue) {
  if (!is_first_) return;
  const bool depth_alone = film_.wants_depth_alone();
  for (size_t k = 0; k < queue.size(); ++k) {
    const uint32_t material = batch_.material[k];
    if (!queue.wants_data(k) || material >= scene_.materials.size() ||
        scene_.materials[material].passing > 0)
      continue;
    if (depth_alone) film_.set_depth(pixel(queue, k), camera_.depth(row(batch_.x, k)));
    else shader_.record(batch_, k, film_, pixel(queue, k));
  }
}

/// What the passes that are means of what is seen have of the hits of camera rays: a share of each
/// path stays at each surface.
void Tracer::note_seen(const Queue& queue) {
  double* const clear = paths_.sums(film_, GLINT_PASS_MIST);
  for (size_t k = 0; k < queue.size(); ++k) {
    if (batch_.material[k] >= scene_.materials.size() || is_held_out(queue, k)) continue;
    const Vec3d T = queue.path(k).T, passed = shader_.passed(batch_, k);
    if (clear) {
      const Vec3d stays{1 - std::clamp(passed.x, 0.0, 1.0), 1 - std::clamp(passed.y, 0.0, 1.0),
                        1 - std::clamp(passed.z, 0.0, 1.0)};
      const double distance = camera_.distance(row(batch_.x, k));
      clear[queue.slot(k)] -= (1 - scene_.world.mist.at(distance)) * mean(T * stays);
    }
    const double weight = mean(T) * (1 - mean(passed));
    if (film_.wants_denoising()) note_denoising(k, queue.slot(k), weight);
    if (!film_.wants_cryptomatte() || !(weight > 0)) continue;
    const GlintInstances& group = scene_.instances.group(batch_.instance[k]);
    meetings_.push_back(
        {queue.slot(k),
         {group.crypto_object, scene_.materials[batch_.material[k]].crypto, group.crypto_asset},
         weight});
  }
}

/// Adds that much of point k's surface to those of its set.
void Tracer::add_guides(const Queue& queue, size_t k, GuideSet set, double share) {
  double* const guides = paths_.guide(film_, kGuidesOfOne * set) + queue.slot(k);
  const Vec3d n = row(batch_.n, k), x = row(batch_.x, k);
  for (size_t c = 0; c < 3; ++c) {
    guides[(kGuideNormal + c) * paths_.stride()] += share * n[int(c)];
    guides[(kGuidePlace + c) * paths_.stride()] += share * x[int(c)];
  }
  guides[kGuideShare * paths_.stride()] += share;
}

/// What tells the film which pixels show the same surface.
void Tracer::note_guides(const Queue& queue) {
  for (size_t k = 0; k < queue.size(); ++k) {
    if (batch_.material[k] >= scene_.materials.size() || is_held_out(queue, k)) continue;
    const double share = mean(queue.path(k).T) * (1 - mean(shader_.passed(batch_, k)));
    if (share > 0) add_guides(queue, k, kSeen, share);
  }
}

/// What denoisers are told of a surface at which that share of the path's sample stays.
void Tracer::note_denoising(size_t k, uint32_t path, double share) {
  const auto add = [&](int pass, Vec3d value) {
    double* const sum = paths_.sums(film_, pass);
    for (size_t c = 0; sum && c < film_.channels_of(pass); ++c)
      sum[c * paths_.stride() + path] += value[int(c)];
  };
  const double far = camera_.distance_seen(row(batch_.x, k));
  add(GLINT_PASS_DENOISING_NORMAL, share * camera_.along_axes(row(batch_.n, k)));
  add(GLINT_PASS_DENOISING_ALBEDO, albedo(k));
  add(GLINT_PASS_DENOISING_DEPTH, share * Vec3d{far, far, far});
}

/// T times about what of even light a point's surface gives back, mirrors and glass without what
/// Fresnel says.
Vec3d Tracer::albedo(size_t k) const {
  Vec3d sum;
  const Material& material = scene_.materials[batch_.material[k]];
  const LobeShape* lobe = scene_.materials.lobes.data() + material.first_lobe;
  for (int i = 0; i < material.passing; ++lobe) {
    if (lobe->kind == GLINT_MIRROR || lobe->kind == GLINT_REFRACTION)
      sum += batch_.passing_term(k, i);
    i += (1u << lobe->kind & kPassing) != 0;
  }
  sum = batch_.queue->path(k).T * sum;
  if (batch_.translucent[0]) sum += row(batch_.translucent, k);
  if (!batch_.lit[k]) return sum;
  const Highlights given = highlights(k);
  return sum + row(batch_.diffuse, k) + given.glossy + given.matt;
}

/// T times about what of even light the highlights of a lit point give back.
Tracer::Highlights Tracer::highlights(size_t k) const {
  Highlights sum;
  const auto add = [&](int kind, Vec3d& to, auto share) {
    const int count = kind == GLINT_SPECULAR ? batch_.highlights()
                                             : scene_.materials.rows_of_lobes.of[kind].count;
    for (int number = 0; number < count; ++number) {
      const double* const row = batch_.lobe_row(kind, number) + k;
      to += share(row) * Vec3d{row[0], row[batch_.stride], row[2 * batch_.stride]};
    }
  };
  const auto all = [](const double*) { return 1.0; };
  add(GLINT_SPECULAR, sum.glossy,
      [&](const double* row) { return 8 / (row[MicrofacetRow::kExponent * batch_.stride] + 2); });
  add(GLINT_TOON_SPECULAR, sum.glossy, all);
  for (const int kind : {GLINT_SHEEN, GLINT_TOON_DIFFUSE}) add(kind, sum.matt, all);
  add(GLINT_OREN_NAYAR, sum.matt, [](const double*) { return kNeverLost; });
  add(GLINT_FIBRE_DIFFUSE, sum.matt, all);
  for (const int kind : {GLINT_FIBRE_SPECULAR, GLINT_FIBRE_TRANSMISSION})
    for (Vec3d* to : {&sum.glossy, &sum.fibre}) add(kind, *to, all);
  return sum;
}

/// The film learns what the paths met, in the order of each pixel's samples.
void Tracer::keep_meetings() {
  const auto earlier = [](const CryptoMeeting& a, const CryptoMeeting& b) {
    return a.path < b.path;
  };
  std::stable_sort(meetings_.begin(), meetings_.end(), earlier);
  for (CryptoMeeting& m : meetings_) m.path = paths_.slot(m.path);
  film_.cryptomatte().add(tile_->number, meetings_);
  meetings_.clear();
}

}  // namespace glint
