// What materials give to AOVs (semantics/passes.md).
#include <algorithm>

#include "integrator/tracer.h"

namespace glint {

/// Those of the meshes, before materials bend them.
void Tracer::keep_mesh_normals() {
  for (size_t c = 0; c < 3; ++c) mesh_normals_[c].assign(batch_.n[c], batch_.n[c] + batch_.size());
}

/// What the surfaces that camera rays meet give to AOVs, up to the first that lets less than half
/// through: material by material.
void Tracer::note_aovs(const Queue& queue) {
  aov_rows_.clear();
  for (uint32_t k = 0; k < queue.size(); ++k)
    if (queue.wants_aovs(k) && batch_.material[k] < scene_.materials.size() &&
        scene_.materials[batch_.material[k]].aov > 0 && !is_held_out(queue, k))
      aov_rows_.push_back(k);
  std::stable_sort(aov_rows_.begin(), aov_rows_.end(),
                   [&](uint32_t a, uint32_t b) { return batch_.material[a] < batch_.material[b]; });
  for (size_t first = 0; first < aov_rows_.size();)
    first += note_aovs_of(queue, aov_rows_.data() + first, aov_rows_.size() - first);
}

/// Those of the rows that share the first one's material, up to a block. How many they are.
size_t Tracer::note_aovs_of(const Queue& queue, const uint32_t* rows, size_t count) {
  const uint32_t number = batch_.material[rows[0]];
  const Material& given = scene_.materials[size_t(scene_.materials[number].aov - 1)];
  size_t here = 1;
  while (here < std::min(count, kBlock) && batch_.material[rows[here]] == number) ++here;
  ProgramPoints points;
  set_aov_points(queue, rows, here, points);
  if (given.program > 0) {
    const ProgramShape& program = *scene_.programs.of(given.program);
    stages_.program({scene_.input_tables(), &program, &points, RayKind::kCamera, here,
                     program_slots_.data(),
                     program.asks_rays ? queries_.at(batch_, sample_, counts_) : nullptr});
  }
  double* const sums = paths_.sums(film_, GLINT_PASS_AOV);
  bool gives[256] = {};
  for (uint32_t l = 0; l < given.lobe_count; ++l) {
    const LobeShape& lobe = scene_.materials.lobes[given.first_lobe + l];
    const size_t aov = size_t(lobe.exponent);
    double color[3][kBlock];
    stages_.coefficients({scene_.input_tables(),
                          &points,
                          here,
                          program_slots_.data(),
                          &lobe,
                          {color[0], color[1], color[2]}});
    for (size_t i = 0; i < here; ++i) {
      const double weight = mean(queue.path(rows[i]).T);
      double* const sum = sums + 4 * aov * paths_.stride() + queue.slot(rows[i]);
      for (size_t c = 0; c < 3; ++c) sum[c * paths_.stride()] += weight * color[c][i];
      if (!gives[aov]) sum[3 * paths_.stride()] += weight;
    }
    gives[aov] = true;
  }
  return here;
}

/// The points of rows of a material as programs read them; normals are the mesh's, where the
/// batch's are bent by now.
void Tracer::set_aov_points(const Queue& queue, const uint32_t* rows, size_t count,
                            ProgramPoints& points) const {
  const bool bent = scene_.materials[batch_.material[rows[0]]].normal > 0;
  for (size_t i = 0; i < (count + kPad - 1) / kPad * kPad; ++i) {
    const uint32_t k = points.row[i] = rows[std::min(i, count - 1)];
    Surface s = batch_.surface(k);
    if (bent) s.n = {mesh_normals_[0][k], mesh_normals_[1][k], mesh_normals_[2][k]};
    set_point(points, i, scene_, s, queue.path(k).start, queue.ray(k).d, queue.tags[k]);
  }
}

}  // namespace glint
