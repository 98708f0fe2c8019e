// Clusters of lamps that far points see as one (semantics/many_lamps.md).
#pragma once
#include <vector>

#include "scene/light.h"

namespace glint {

/// A lamp, the first and the last of its samples and the one after all of them, and whether these
/// lie on a disc that faces what it lights.
struct ClusteredLamp {
  const Light* light;
  uint32_t first, last, end;
  bool is_disc;
};

/// A cluster before those within it, which halve the lamps where their levels are highest.
std::vector<LampCluster> clusters_of(const std::vector<ClusteredLamp>& lamps);

}  // namespace glint
