//! Kernels compiled twice: for any machine, and for x86-64 with AVX2 and FMA, chosen once at run time.
//!
//! The setting `IK_INSTRUCTIONS=portable` in the environment keeps a process on the portable variant; tests run both.
//! Results of the two differ by rounding.

use std::sync::OnceLock;

/// What a kernel may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// What every target of the compiler has.
    Portable,
    /// Four lanes and fused multiply-add (x86-64-v3).
    Avx2Fma,
}

/// The variant this process uses; decided at the first call.
pub fn instructions() -> Instructions {
    static CHOSEN: OnceLock<Instructions> = OnceLock::new();
    *CHOSEN.get_or_init(|| {
        let portable = std::env::var_os("IK_INSTRUCTIONS").is_some_and(|value| value == "portable");
        if portable { Instructions::Portable } else { best() }
    })
}

#[cfg(target_arch = "x86_64")]
fn best() -> Instructions {
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        Instructions::Avx2Fma
    } else {
        Instructions::Portable
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn best() -> Instructions {
    Instructions::Portable
}

/// A kernel: `run` and everything it calls must be `#[inline(always)]`, so that it is compiled for the variant.
pub trait Kernel {
    /// What it returns.
    type Output;
    /// The work; with `FMA` products and sums are fused.
    fn run<const FMA: bool>(self) -> Self::Output;
}

/// Runs a kernel in the variant of this process.
#[inline]
pub fn run<K: Kernel>(kernel: K) -> K::Output {
    match instructions() {
        Instructions::Portable => kernel.run::<false>(),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2Fma => avx2_fma::run(kernel),
        #[cfg(not(target_arch = "x86_64"))]
        Instructions::Avx2Fma => kernel.run::<false>(),
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(
    unsafe_code,
    reason = "the one place where a function with target features is called"
)]
mod avx2_fma {
    use super::Kernel;

    pub(super) fn run<K: Kernel>(kernel: K) -> K::Output {
        // SAFETY: `instructions` returns this variant only where both features were detected.
        unsafe { with_features(kernel) }
    }

    #[target_feature(enable = "avx2,fma")]
    fn with_features<K: Kernel>(kernel: K) -> K::Output {
        kernel.run::<true>()
    }
}
