//! What the validation layer says.

use ash::{ext::debug_utils, vk};
use std::{
    ffi::{CStr, c_void},
    sync::{Mutex, PoisonError},
};

/// The validation layer of the Khronos Group.
pub(super) const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Most messages that are kept: one fault in a loop can be reported millions of times.
const KEPT: usize = 100;

type Texts = Mutex<Vec<String>>;

/// Collects messages for as long as an instance lives.
pub(super) struct Messages {
    functions: debug_utils::Instance,
    messenger: vk::DebugUtilsMessengerEXT,
    /// Boxed, because the layer holds its address.
    texts: Box<Texts>,
}

impl Messages {
    /// `None` if the layer will not talk.
    pub(super) fn new(entry: &ash::Entry, instance: &ash::Instance) -> Option<Self> {
        let functions = debug_utils::Instance::new(entry, instance);
        let texts = Box::new(Texts::default());
        let create = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::ERROR
                    | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
            )
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(receive))
            .user_data(std::ptr::from_ref::<Texts>(&texts).cast_mut().cast());
        // SAFETY: the extension is enabled, and the texts live until the messenger is destroyed:
        // `destroy` comes before the drop.
        let messenger = unsafe { functions.create_debug_utils_messenger(&create, None) }.ok()?;
        Some(Self { functions, messenger, texts })
    }

    pub(super) fn texts(&self) -> Vec<String> {
        self.texts.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Ends the messages. Once, before the instance is destroyed.
    pub(super) fn destroy(&self) {
        // SAFETY: the instance lives, and this is called once, by its drop.
        unsafe { self.functions.destroy_debug_utils_messenger(self.messenger, None) };
    }

    /// Keeps everything, for a driver that may still call.
    pub(super) fn leak(self) {
        std::mem::forget(self.texts);
    }
}

unsafe extern "system" fn receive(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    texts: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes valid data, and the address given to it, behind which a `Texts`
    // lives (`Messages::new`).
    let (data, texts) = unsafe { (data.as_ref(), texts.cast::<Texts>().as_ref()) };
    // SAFETY: the layer's text ends with a zero and outlives the call.
    let text = data.and_then(|data| unsafe { data.message_as_c_str() });
    if let (Some(text), Some(texts)) = (text, texts) {
        let mut texts = texts.lock().unwrap_or_else(PoisonError::into_inner);
        if texts.len() < KEPT {
            texts.push(text.to_string_lossy().into_owned());
        }
    }
    vk::FALSE
}
