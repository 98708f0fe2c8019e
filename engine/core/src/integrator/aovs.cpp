// What materials give to AOVs (SEMANTICS.md, Passes).
#include <algorithm>

#include "integrator/tracer.h"

namespace glint {

/// What the surfaces that camera rays meet give to AOVs, up to the first that lets less than half
/// through: material by material.
void Tracer::note_aovs(const Queue& queue) {
  aov_rows_.clear();
  for (uint32_t k = 0; k < queue.size(); ++k)
    if (queue.wants_aovs(k) && batch_.material[k] < scene_.materials.size() &&
        scene_.materials[batch_.material[k]].aov > 0)
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
  Surface surfaces[kBlock];
  for (size_t i = 0; i < here; ++i) {
    surfaces[i] = batch_.surface(rows[i]);
    if (scene_.materials[number].normal > 0)  // the batch's is bent by now
      surfaces[i].n = {mesh_normals_[0][rows[i]], mesh_normals_[1][rows[i]],
                       mesh_normals_[2][rows[i]]};
  }
  if (given.program > 0) run_aovs(queue, given, rows, surfaces, here);
  double* const sums = paths_.sums(film_, GLINT_PASS_AOV);
  bool gives[256] = {};
  for (uint32_t l = 0; l < given.lobe_count; ++l) {
    const Lobe& lobe = scene_.lobes[given.first_lobe + l];
    const size_t aov = size_t(lobe.exponent);
    for (size_t i = 0; i < here; ++i) {
      PointReads reads;
      reads.slots = program_slots_.data() + i;
      const Vec3d color = coefficient(scene_, lobe, surfaces[i], reads);
      const double weight = mean(queue.path(rows[i]).T);
      double* const sum = sums + 4 * aov * paths_.stride() + queue.slot(rows[i]);
      for (size_t c = 0; c < 3; ++c) sum[c * paths_.stride()] += weight * color[int(c)];
      if (!gives[aov]) sum[3 * paths_.stride()] += weight;
    }
    gives[aov] = true;
  }
  return here;
}

/// The program of a material's AOVs at up to a block of points.
void Tracer::run_aovs(const Queue& queue, const Material& given, const uint32_t* rows,
                      const Surface* surfaces, size_t count) {
  ProgramPoints points{};
  for (size_t i = 0; i < (count + kPad - 1) / kPad * kPad; ++i) {
    const Surface& s = surfaces[std::min(i, count - 1)];
    const Vec3d d = queue.ray(rows[std::min(i, count - 1)]).d;
    points.instance[i] = s.instance;
    points.primitive[i] = s.primitive;
    points.outside[i] = s.outside ? -1 : 0;
    for (int c = 0; c < 3; ++c) {
      points.weights[c][i] = s.weights[c];
      points.x[c][i] = s.x[c];
      points.g[c][i] = s.g[c];
      points.n[c][i] = s.n[c];
      points.d[c][i] = d[c];
    }
    const uint32_t row = rows[std::min(i, count - 1)];
    points.length[i] = length(s.x - queue.path(row).start) / scene_.anchor.scale;
    points.tags[i] = queue.tags()[row];
    points.offset[i] = s.offset;
    points.row[i] = row;
  }
  const ProgramShape& program = scene_.program_of(given);
  stages_.program({scene_.input_tables(), &program, &points, RayKind::kCamera, count,
                   program_slots_.data(),
                   program.asks_rays ? queries_.at(batch_, sample_, counts_) : nullptr});
}

}  // namespace glint
