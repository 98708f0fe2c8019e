// The last first-hit caches of a scene.
#pragma once
#include <memory>
#include <mutex>
#include <vector>

#include "glint.h"

namespace glint {

class Film;
class FirstHitCache;
struct RenderPlan;

class FirstHitCaches {
 public:
  /// What is known of the first wave of such a render; nothing as yet for one that is new.
  std::shared_ptr<FirstHitCache> of(const GlintCamera& camera, const RenderPlan& plan,
                                    const Film& film);
  /// Has those of another scene, too.
  void share(const FirstHitCaches& other);

 private:
  std::vector<std::shared_ptr<FirstHitCache>> caches_;  // newest first
  mutable std::mutex mutex_;
};

}  // namespace glint
