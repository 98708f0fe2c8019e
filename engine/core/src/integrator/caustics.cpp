// Light of lamps that mirrors and glass throw onto what is matt, read of the picture's photons.
#include "integrator/photon_map.h"
#include "integrator/tracer.h"

namespace glint {

void Tracer::add_caustics(const Queue& queue) {
  if (!plan_.photon_map || !direct_.bounces(queue)) return;
  const bool translucent = batch_.translucent[0] != nullptr;
  for (size_t k = 0; k < queue.size(); ++k) {
    if (!batch_.lit[k] || batch_.missed(k)) continue;
    const Vec3d x = row(batch_.points.x, k), g = row(batch_.points.g, k);
    const auto add = [&](Vec3d side, Vec3d given) {
      if (!any(given)) return;
      Vec3d sum;
      plan_.photon_map->each_at(x, side, [&](const Photon& photon, double share) {
        const Vec3d light = share * given * Vec3d(photon.flux);
        sum += light;
        if (batch_.has_groups()) batch_.add_to_group(photon.group, k, light);
      });
      Batch::add_to(batch_.sums.total, k, sum);
    };
    add(g, row(batch_.diffuse, k));
    if (translucent) add(-g, row(batch_.translucent, k));
  }
}

}  // namespace glint
