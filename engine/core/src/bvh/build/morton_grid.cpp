#include "bvh/build/morton_grid.h"

#include <algorithm>

#include "bvh/build/builder_nodes.h"
#include "bvh/build/builder_split.h"

namespace glint {
namespace {

class Halver {
 public:
  Halver(const Ref* refs, const std::vector<size_t>& start, const BuildOptions& options,
         std::vector<Node>& nodes)
      : refs_(refs), start_(start), options_(options), nodes_(nodes) {}

  ChildRef make() {
    return make({0, uint32_t(start_.size() - 1), start_.front(), start_.back()}).ref;
  }

 private:
  /// Refs [begin, end), those of `count` cells; of no cells once they are a part of one.
  struct Cells {
    uint32_t first, count;
    size_t begin, end;
    size_t refs() const { return end - begin; }
  };
  struct Child {
    ChildRef ref;
    Box box;
  };

  Child make(const Cells& all) {
    if (all.refs() <= options_.max_leaf)
      return {leaf_ref(all.begin, all.refs()), ref_box(refs_ + all.begin, refs_ + all.end)};
    Cells cells[kWidth] = {all};
    int count = 1;
    for (int k; count < kWidth && cells[k = fullest(cells, count)].refs() > options_.min_leaf;
         ++count)
      halve(cells[k], cells[count]);
    const size_t index = nodes_.size();
    nodes_.emplace_back();
    Box box;
    for (int k = 0; k < kWidth; ++k) {
      if (k >= count) {
        set_child(nodes_[index], k, nullptr);
        continue;
      }
      const Child child = make(cells[k]);
      set_child(nodes_[index], k, &child.box);
      nodes_[index].child[k] = child.ref;
      box.add(child.box);
    }
    return {ChildRef(index), box};
  }
  static int fullest(const Cells* cells, int count) {
    return int(
        std::max_element(cells, cells + count,
                         [](const Cells& a, const Cells& b) { return a.refs() < b.refs(); }) -
        cells);
  }
  /// Leaves the first half, neither of them empty; halves without a ref are skipped.
  void halve(Cells& whole, Cells& second) const {
    for (; whole.count > 1; whole.count /= 2) {
      const uint32_t half = whole.count / 2, middle = whole.first + half;
      const size_t cut = start_[middle];
      if (cut == whole.begin) {
        whole.first = middle;
        continue;
      }
      if (cut == whole.end) continue;
      second = {middle, half, cut, whole.end};
      whole = {whole.first, half, whole.begin, cut};
      return;
    }
    const size_t cut = whole.begin + whole.refs() / 2;
    second = {0, 0, cut, whole.end};
    whole = {0, 0, whole.begin, cut};
  }

  const Ref* refs_;
  const std::vector<size_t>& start_;
  const BuildOptions& options_;
  std::vector<Node>& nodes_;
};

}  // namespace

ChildRef halve_cells(const Ref* refs, const std::vector<size_t>& start, const BuildOptions& options,
                     std::vector<Node>& nodes) {
  return Halver(refs, start, options, nodes).make();
}

}  // namespace glint
