// Nodes as the builders write them.
#pragma once
#include <vector>

#include "bvh/bounds.h"
#include "bvh/bvh.h"

namespace glint {

constexpr int kMedianDepth =
    40;  // from here on ranges are halved, so that kMaxDepth holds: 2^28 refs are 28 halvings away

inline ChildRef leaf_ref(size_t first, size_t count) {
  return kLeaf | ChildRef(count - 1) << kCountShift | ChildRef(first);
}

/// Without a box: no child.
inline void set_child(Node& node, int lane, const Box* box) {
  const float inf = std::numeric_limits<float>::infinity();
  for (int k = 0; k < 3; ++k) {
    node.planes[2 * k][lane] = box ? box->lo[k] : inf;
    node.planes[2 * k + 1][lane] = box ? box->hi[k] : -inf;
  }
  node.child[lane] = 0;
  node.turned = 0;
}

/// Copies nodes; moved(c) is where a child is there.
template <class Moved>
void move_nodes(const std::vector<Node>& nodes, Node* out, Moved moved) {
  for (Node node : nodes) {
    for (int lane = 0; lane < kWidth; ++lane)
      if (node.planes[0][lane] <= node.planes[1][lane]) node.child[lane] = moved(node.child[lane]);
    *out++ = node;
  }
}

}  // namespace glint
