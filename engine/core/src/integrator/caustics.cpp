// Light of lamps that mirrors and glass throw onto what is matt, read of the picture's photons.
#include "integrator/tracer.h"

namespace glint {

/// Adds it to the batch: light of others that is smooth as it is, and not averaged.
void Tracer::add_caustics(const Queue& queue, bool to_parts) {
  if (!plan_.photon_map || !direct_.onward.bounces(queue) ||
      queue.past.caught != Queue::Past::kSeen)
    return;
  const bool seen = queue.visibility == kCamera;
  double* const thrown = seen && to_parts ? paths_.sums(film_, kPhotonLight) : nullptr;
  for (size_t k = 0; k < queue.size(); ++k) {
    if (batch_.missed(k) || is_caught(queue, k)) continue;
    const Vec3d x = row(batch_.x, k), g = row(batch_.g, k);
    const auto add = [&](Vec3d side, Vec3d given) {
      if (!any(given)) return;
      plan_.photon_map->find(x, side, photons_);
      for (const PhotonMap::Found& found : photons_) {
        const Vec3d light = given * found.light();
        Batch::add_to(batch_.sums.total, k, light);
        if (seen && to_parts) Batch::add_to(batch_.sums.diffuse, k, light);
        batch_.add_to_group(plan_.photon_map->group(found), k, light);
        for (int c = 0; thrown && c < 3; ++c)
          thrown[size_t(c) * paths_.stride() + queue.slot(k)] += light[c];
      }
    };
    if (batch_.lit[k]) add(g, row(batch_.diffuse, k));
    if (batch_.translucent[0]) add(-g, row(batch_.translucent, k));
  }
}

}  // namespace glint
