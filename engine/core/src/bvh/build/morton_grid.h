// Nodes by halving the cells of a grid: the fastest way to a tree, and the one that costs rays
// most.
#pragma once
#include <vector>

#include "bvh/build/builder.h"

namespace glint {

/// Appends the nodes over refs that lie in the cells of a grid: cell c those from start[c] to
/// start[c + 1], a power of two of cells. Those with the most refs are halved. Returns the root.
ChildRef halve_cells(const Ref* refs, const std::vector<size_t>& start, const BuildOptions& options,
                     std::vector<Node>& nodes);

}  // namespace glint
