#include "film/cryptomatte.h"

#include <algorithm>

namespace glint {

void Cryptomatte::add(size_t tile, const std::vector<CryptoMeeting>& meetings) {
  for (int k = 0; k < 3; ++k) {
    if (!wants(k) || meetings.empty()) continue;
    std::vector<Share>& old = shares_[k][tile];
    std::vector<Share> all;
    all.reserve(old.size() + meetings.size());
    auto next = old.begin();
    size_t first = 0;  // of the slot's shares
    for (size_t i = 0; i < meetings.size(); ++i) {
      const CryptoMeeting& m = meetings[i];
      if (i == 0 || m.path != meetings[i - 1].path) {
        for (; next != old.end() && next->slot < m.path; ++next) all.push_back(*next);
        first = all.size();
        for (; next != old.end() && next->slot == m.path; ++next) all.push_back(*next);
      }
      const auto known = std::find_if(all.begin() + std::ptrdiff_t(first), all.end(),
                                      [&](const Share& s) { return s.id == m.ids[k]; });
      if (known != all.end()) known->weight += m.weight;
      else all.push_back({m.path, m.ids[k], m.weight});
    }
    all.insert(all.end(), next, old.end());
    old.swap(all);
  }
}

void Cryptomatte::rank(std::vector<Share>& shares) {
  std::sort(shares.begin(), shares.end(), [](const Share& a, const Share& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.id < b.id;
  });
}

}  // namespace glint
