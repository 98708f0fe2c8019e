// Surfaces as sums of lobes, and what of them does not vary, folded to terms.
#pragma once
#include <vector>

#include "glint.h"
#include "math/vec.h"
#include "scene/programs.h"
#include "shading/closure/table.h"
#include "shading/stages.h"

namespace glint {

inline bool is_fibre(int kind) { return kClosures[kind].of_fibre; }

struct Material {
  uint32_t first_lobe = 0, lobe_count = 0;
  int32_t index = 0, program = 0, normal = 0;  // as GlintMaterial has them
  uint32_t crypto = 0;
  int32_t aov = 0, medium = 0, bump_shadowing = 0, base_normal = 0;
  uint32_t kinds = 0;  // bit 1 << kind for each of its lobes
  int view_count = 0;
  bool goes_below = false;  // light of some of its DIFFUSE lobes comes out elsewhere
  int passing = 0;          // lobes that send rays on, unless all of these are nothing
  bool is_rough_glass = false;
  bool is_dense = false;  // light to lamps goes into something denser, or out of it
  bool has(int kind) const { return kinds >> kind & 1; }
  /// Whether normals of the lobe are lifted so far that mirrors see nothing below the surface.
  bool lifts(const LobeShape& lobe) const {
    const bool shiny = lobe.kind == GLINT_SPECULAR
                           ? lobe.masking > 0
                           : lobe.kind == GLINT_MIRROR || lobe.kind == GLINT_REFRACTION;
    return shiny && program > 0 && bump_shadowing >= GLINT_BUMP_CHIANG;
  }
};

/// Lobes that light from everywhere, or of matt surfaces, meets at some directions of view more
/// than at others.
inline bool depends_on_view(const LobeShape& lobe) {
  return (lobe.kind == GLINT_AMBIENT || lobe.kind == GLINT_DIFFUSE) && lobe.exponent > 0;
}

/// Lobes whose light comes out of the surface beside where it goes in.
inline bool goes_below(const GlintLobe& lobe) {
  return lobe.kind == GLINT_DIFFUSE &&
         (lobe.radius_slot > 0 || lobe.radius[0] > 0 || lobe.radius[1] > 0 || lobe.radius[2] > 0);
}

/// Of a lobe that does not vary.
inline Vec3d coefficient(const LobeShape& lobe) { return {lobe.k[0], lobe.k[1], lobe.k[2]}; }

/// What an input comes to whose image, attribute and program multiply to `read`: that times its
/// value, with its offset, bounds and complement. Finite.
Vec3d factor_of(const GlintInput& input, double read = 1);

/// Whether two inputs look at the same of an image.
bool same_read(const GlintInput& a, const GlintInput& b);

struct MaterialTable {
  std::vector<Material> rows;  // the last one is the default surface
  std::vector<LobeShape> lobes;
  std::vector<GlintInput> inputs;
  std::vector<uint32_t> reads;  // for each input, the first of its material (or that itself) that
                                // reads the same of an image
  std::vector<TextureShape> textures;
  std::vector<MaterialTerms> terms, reflected_terms;  // reflected: as rays see them that rough
                                                      // surfaces reflect
  std::vector<double> specular_terms;                 // the columns of `rows_of_lobes` a material
  std::vector<double> view_terms;  // max_view rows of ViewTerm::kColumns a material
  LobeLayout rows_of_lobes;        // that lights need
  std::vector<LobeSpan> spans;     // of each, microfacets' last
  /// Rows of microfacets: rays of bounced light (gathers) see mirrors among them.
  int highlights(bool gathers) const {
    const LobeRows* const of = rows_of_lobes.of;
    return of[GLINT_SPECULAR].count + (gathers ? of[GLINT_MIRROR].count : 0);
  }
  /// Those of other lobes, which come first.
  size_t other_count() const { return spans.size() - size_t(highlights(true)); }
  double most_exponent = 0;  // of SPECULAR lobes
  // SPECULAR lobes of GGX's masking, and which
  bool has_metals = false, has_varnish = false, has_gloss = false, has_mirrors = false;
  bool has_toon_gloss = false;             // TOON_SPECULAR lobes, whose surroundings no rays show
  double least_gloss_exponent = HUGE_VAL;  // of SPECULAR lobes with masking
  bool has_rough_glass = false, has_fibre = false;
  bool has_translucent = false;
  bool has_dense = false;       // Material::is_dense
  bool has_subsurface = false;  // DIFFUSE lobes whose light comes out elsewhere
  int max_view = 0;             // lobes of a material that depend on the view, at most
  int max_passing = 0;          // Material::passing, at most
  int passing_columns = PassingTerm::kPlain;  // of each of these lobes
  bool bends_normals = false;                 // some material gives shading normals of its own
  bool shadows_bumps = false;                 // and hides light by them
  bool turns_lobes = false;                   // some SPECULAR lobe may have a normal of its own
  bool stretches_lobes = false;               // and one may be stretched
  bool edges_lobes = false;                   // and one may have the weight of edges

  /// Whether bounced light is shown by gloss as if it were matt. by_rays: the surroundings are.
  bool has_even_gloss(bool by_rays) const { return has_toon_gloss || (has_varnish && !by_rays); }

  size_t size() const { return rows.size(); }
  const Material& operator[](size_t number) const { return rows[number]; }
  // Numbers beyond those of the materials are of points without one: rays that see the surroundings
  // or, with a transparent film, nothing.
  uint32_t surroundings() const { return uint32_t(size()); }
  uint32_t nothing() const { return uint32_t(size()) + 1; }
  /// Of places where light comes out of a surface: matt and white.
  uint32_t white() const { return uint32_t(size()) + 3; }
};

MaterialTable compile_materials(const GlintSceneData& data, const World& world);

/// Reflected rays see no surfaces glow that are lights as well.
void hide_emission(MaterialTable& t);

}  // namespace glint
