// The BVHs of a scene and what rays pass in them without a stop: made once by whoever asks first,
// or taken over from an earlier scene where nothing changed.
#pragma once
#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "bvh/accel.h"
#include "scene/anchor.h"
#include "scene/light.h"

namespace glint {

class OpacityMaps;
class PassedInstances;
struct Scene;

std::vector<GeometryView> geometry_views(const GlintGeometry* geometries, size_t count);

class SceneTrees {
 public:
  SceneTrees();
  ~SceneTrees();

  /// Trees of an earlier scene, and where its coordinates are.
  struct Earlier {
    AccelBase trees;
    Anchor anchor;
  };

  /// Has the trees of `base` at hand. geometry_there: the numbers there of this scene's geometries,
  /// AccelBase::kNone for others.
  void begin_like(const Scene& base, const std::vector<uint32_t>& geometry_there, bool exact);
  /// Where the trees at hand are, null for none.
  const Anchor* earlier() const { return earlier_.trees.accel ? &earlier_.anchor : nullptr; }
  /// Once the scene is placed: takes over what is the same in `base`. Whether that is all of the
  /// BVH.
  bool share(const Scene& scene, const Scene& base, const std::vector<uint32_t>& geometry_there,
             bool exact);

  /// Makes the trees unless they are there; false when `cancel` became true.
  bool build(const Scene& scene, int threads, BuildQuality quality,
             const std::atomic<bool>& cancel);

  // After build().
  const Accel& accel() const { return *accel_; }
  /// Of a mesh light alone; where highlights draw directions.
  const Accel& emitters(const Light& light) const { return *emitter_accels_[light.table_number]; }
  /// Of what encloses media alone: instance k is that of enclosure k. Where there are any.
  const Accel& media() const { return *media_accel_; }
  /// Where rays pass surfaces without a stop; null where nothing lets light through.
  const Opacity* opacity() const;
  /// The same for the shadow rays of one of the scene's lights.
  const Opacity* opacity(const Light& light) const;
  /// The same where catchers alone cast shadows; in scenes that have some.
  const Opacity* opacity_of_catchers(const Light& light) const;
  const Opacity* opacity_of_catchers() const;
  double build_seconds() const { return build_seconds_; }

 private:
  Earlier at_hand(size_t geometry_count, const Anchor& anchor) const;
  void share_emitters(const LightTable& lights, const Scene& base);
  void find_opacity(const Scene& scene);
  bool build_emitters(const LightTable& lights, int threads, const std::atomic<bool>& cancel);
  bool build_media(const Scene& scene, int threads, const std::atomic<bool>& cancel);

  std::shared_ptr<const Accel> accel_, media_accel_;
  std::vector<std::shared_ptr<const Accel>> emitter_accels_;   // of the mesh lights
  std::shared_ptr<const std::vector<uint32_t>> emitter_rows_;  // of the corners, three an emitter
  std::unique_ptr<const OpacityMaps> opacity_;
  std::vector<std::unique_ptr<const PassedInstances>> passed_,
      caught_;  // by light; null: of most. caught_: all but catchers; the last one: of those most
  bool exact_ = true;  // accel_ is what a scene without a base would have
  Earlier earlier_;    // until there is accel_
  double build_seconds_ = 0;
  mutable std::mutex mutex_;
};

}  // namespace glint
