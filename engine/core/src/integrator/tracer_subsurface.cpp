// Light that goes below surfaces and comes out elsewhere: there the tracer sees a matt white
// surface, which weighs as much as comes out.
#include <algorithm>

#include "film/refine.h"
#include "integrator/tracer.h"

namespace glint {

/// Of what is seen blurred, or thrown on to others, light comes out where it goes in.
void Tracer::scatter_below(const Queue& queue) {
  subsurface_.enter(batch_, sample_, [&](uint32_t k) { return !is_caught(queue, k); });
  Queue exits = take(queue.visibility, queue.past);
  exits.exits = true;
  subsurface_.leave(batch_, queries_, exits, counts_);
  wait(std::move(exits));
}

void Tracer::show_exits(const Queue& queue) {
  exit_materials_.assign(queue.size(), scene_.materials.white());
  ShadeStage stage = batch_.shading();
  stage.material = exit_materials_.data();
  stages_.shade(stage);
  if (scene_.materials.bends_normals) bend_exits(queue);
}

/// Their normals are those of their materials' programs.
void Tracer::bend_exits(const Queue& queue) {
  std::vector<uint32_t>& rows = exit_rows_;
  rows.clear();
  for (uint32_t k = 0; k < queue.size(); ++k)
    if (scene_.materials[batch_.material[k]].normal > 0) rows.push_back(k);
  std::stable_sort(rows.begin(), rows.end(),
                   [&](uint32_t a, uint32_t b) { return batch_.material[a] < batch_.material[b]; });
  for (size_t first = 0; first < rows.size();) {
    const uint32_t number = batch_.material[rows[first]];
    EvaluateStage stage = varying(queue, scene_.materials[number]);
    stage.rows = rows.data() + first;
    while (first < rows.size() && batch_.material[rows[first]] == number) {
      ++stage.count;
      ++first;
    }
    stage.lobe_count = 0;
    stage.translucent[0] = stage.below[0] = nullptr;
    stages_.vary(stage);
  }
  for (uint32_t k : rows) {
    set_row(batch_.diffuse, k, queue.weight(k));
    batch_.lit[k] = -1;
  }
}

}  // namespace glint
