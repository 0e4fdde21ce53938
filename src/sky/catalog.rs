//! stub
#![allow(missing_docs)]
#[derive(Debug, Clone)]
pub struct Star {
    pub hip: u32,
    pub hr: u16,
    pub ra_rad: f64,
    pub dec_rad: f64,
    pub parallax_rad: f64,
    pub pm_ra_cosdec_rad_yr: f64,
    pub pm_dec_rad_yr: f64,
    pub v_mag: f64,
    pub b_v: f64,
}
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Selection {
    Hipparcos,
    Bsc,
}
#[derive(Debug, Clone)]
pub struct Catalog {
    stars: Vec<Star>,
}
impl Catalog {
    pub fn embedded(_: Selection) -> Catalog {
        Catalog { stars: vec![] }
    }
    pub fn stars(&self) -> &[Star] {
        &self.stars
    }
    pub fn id(&self, s: &Star) -> String {
        format!("HIP {}", s.hip)
    }
    pub fn names(&self, _: &Star) -> Vec<String> {
        vec![]
    }
}
