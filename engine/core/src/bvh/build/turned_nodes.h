// Boxes along the hair: nodes of trees of strands whose boxes are smaller along axes of their own
// (Woop, Benthin, Wald, Johnson, Tabellion 2014, Exploiting Local Orientation Similarity for
// Efficient Ray Traversal of Hair and Fur).
#pragma once
#include "bvh/source.h"

namespace glint {

/// Turns the nodes of a tree over strands where that makes their boxes smaller by more than it
/// costs. Whether there are any. The same for every pool.
bool turn_nodes(Tree& tree, ThreadPool& pool);

}  // namespace glint
